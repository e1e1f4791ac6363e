//! The mistakes, each with the promise that it breaks. `broken!` asks whether its mistake is made.

use rohrpost_planted::{Edit, and_not, edit, instead, left_out, or};

/// A mistake that one could make.
pub(crate) struct Mistake {
    pub(crate) name: &'static str,
    pub(crate) edits: &'static [Edit],
    /// The test that fails.
    pub(crate) promise: &'static str,
}

const FINAL: &str = "lookups::answers_are_right_and_final_in_each_order_of_arrival";
const REASONS: &str = "lookups::each_reason_says_how_far";
const RATE: &str = "interpolation::rotations_turn_at_a_constant_rate_the_short_way";
const OPPOSITE: &str = "interpolation::opposite_headings_and_rotations_turn_one_way";
const TWO: &str = "matching::two_streams_are_joined_as_the_definition_says";
const THREE: &str = "matching::three_streams_are_joined_as_the_definition_says";
const SILENT: &str = "matching::a_silent_stream_is_named_and_memory_stays_bounded";

pub(crate) const MISTAKES: &[Mistake] = &[
    // ---- values in between ----
    Mistake {
        name: "headings_turn_the_long_way",
        edits: &[instead("interpolate.rs", "wrap_rad(to - from)", "to - from")],
        promise: "interpolation::a_heading_crosses_the_seam",
    },
    Mistake {
        name: "values_are_extrapolated",
        edits: &[and_not("interpolate.rs", "if gone_ns > whole_ns")],
        promise: "interpolation::no_share_lies_outside",
    },
    Mistake {
        name: "the_later_value_is_the_nearer_one",
        edits: &[edit(
            "interpolate.rs",
            "if self.0 > 0.5 {",
            "if self.0 > 0.5 || broken!(the_later_value_is_the_nearer_one) && self.0 > 0.0 {",
        )],
        promise: "interpolation::each_field_goes_its_own_way",
    },
    Mistake {
        name: "half_turns_go_clockwise",
        edits: &[edit(
            "angle.rs",
            "if turned > PI {",
            "if turned > PI || broken!(half_turns_go_clockwise) && turned >= PI {",
        )],
        promise: OPPOSITE,
    },
    Mistake {
        name: "rotations_turn_the_long_way",
        edits: &[and_not("nalgebra_types.rs", "if cosine < 0.0")],
        promise: RATE,
    },
    Mistake {
        name: "half_turns_depend_on_the_quaternion",
        edits: &[and_not("nalgebra_types.rs", "(cosine == 0.0 && points_back()")],
        promise: OPPOSITE,
    },
    // Straight through the sphere, then out to it: quick in the middle.
    Mistake {
        name: "rotations_go_straight",
        edits: &[edit(
            "nalgebra_types.rs",
            "let half_rad = share.get() * sine.atan2(cosine);",
            "let gone = share.get();
        let straight_rad = (gone * sine).atan2(1.0 - gone + gone * cosine);
        let half_rad = if broken!(rotations_go_straight) { straight_rad } else { gone * sine.atan2(cosine) };",
        )],
        promise: RATE,
    },
    // ---- the order of a stream ----
    Mistake {
        name: "records_stand_as_they_come",
        edits: &[edit(
            "sorted.rs",
            "let mut left = None;",
            "let mut left = None;
        if broken!(records_stand_as_they_come) { at = self.records.len(); }",
        )],
        promise: FINAL,
    },
    Mistake {
        name: "numbers_do_not_order_equal_stamps",
        edits: &[instead("sorted.rs", "(known.stamp, known.sequence) < key", "known.stamp <= key.0")],
        promise: FINAL,
    },
    Mistake {
        name: "late_records_are_taken",
        edits: &[and_not("sorted.rs", "if by_ns > 0 && by_ns >= self.lateness_ns")],
        promise: REASONS,
    },
    Mistake {
        name: "records_of_an_earlier_epoch_are_taken",
        edits: &[and_not("sorted.rs", "if stamp.epoch < newest.epoch")],
        promise: REASONS,
    },
    Mistake {
        name: "records_settle_too_early",
        edits: &[edit(
            "sorted.rs",
            "|by_ns| by_ns >= self.lateness_ns)",
            "|by_ns| by_ns + if broken!(records_settle_too_early) { 2 } else { 0 } >= self.lateness_ns)",
        )],
        promise: "matching::a_set_waits_for_a_better_record_that_may_still_come",
    },
    Mistake {
        name: "memory_has_no_bound",
        edits: &[and_not("sorted.rs", "if self.records.len() == self.capacity")],
        promise: SILENT,
    },
    Mistake {
        name: "epochs_are_put_together",
        edits: &[left_out("history.rs", "self.sorted.clear();")],
        promise: REASONS,
    },
    // ---- lookups ----
    Mistake {
        name: "the_record_after_may_be_open",
        edits: &[edit(
            "lookup.rs",
            "settled(after_ns)?;",
            "settled(if broken!(the_record_after_may_be_open) { stamp.ns } else { after_ns })?;",
        )],
        promise: FINAL,
    },
    Mistake { name: "gaps_are_bridged", edits: &[and_not("lookup.rs", "if gap_ns > gap_max_ns")], promise: REASONS },
    Mistake {
        name: "another_epoch_is_asked",
        edits: &[and_not("lookup.rs", "if stamp.epoch != known")],
        promise: REASONS,
    },
    Mistake {
        name: "the_first_of_a_stamp_answers",
        edits: &[and_not("lookup.rs", "Some(next_ns) if next_ns == after_ns")],
        promise: "lookups::without_lateness_the_newest_record_answers_at_once",
    },
    Mistake {
        name: "what_is_forgotten_is_empty",
        edits: &[edit(
            "lookup.rs",
            "oldest_ns.map_or(NoValue::Empty,",
            "oldest_ns.filter(|_| !broken!(what_is_forgotten_is_empty)).map_or(NoValue::Empty,",
        )],
        promise: "lookups::what_is_overwritten_during_a_lookup_is_forgotten",
    },
    // ---- sets ----
    Mistake {
        name: "sets_are_too_large",
        edits: &[edit(
            "matcher.rs",
            "apart_ns > self.tolerance_ns",
            "apart_ns > self.tolerance_ns + if broken!(sets_are_too_large) { 1 } else { 0 }",
        )],
        promise: TWO,
    },
    Mistake {
        name: "sets_have_records_of_two_epochs",
        edits: &[edit(
            "matcher.rs",
            "latest.since(first).is_none_or(",
            "latest.since(first).map_or(!broken!(sets_have_records_of_two_epochs), ",
        )],
        promise: TWO,
    },
    Mistake { name: "the_first_set_is_taken", edits: &[or("matcher.rs", "if start >= pivot")], promise: TWO },
    Mistake {
        name: "of_equal_sets_the_last_is_taken",
        edits: &[edit(
            "matcher.rs",
            "if size_ns < least_ns {",
            "if size_ns < least_ns || broken!(of_equal_sets_the_last_is_taken) && size_ns == least_ns {",
        )],
        promise: TWO,
    },
    // A later set may be smaller, and leaves out one that could have been formed before it.
    Mistake {
        name: "the_search_passes_the_pivot",
        edits: &[edit(
            "matcher.rs",
            "let pivot = latest(&stamps);",
            "let mut pivot = latest(&stamps);
        if broken!(the_search_passes_the_pivot) { pivot.ns += 3; }",
        )],
        promise: TWO,
    },
    Mistake {
        name: "what_may_still_come_is_ignored",
        edits: &[edit(
            "matcher.rs",
            "if matches!(next, Place::NotBefore(_)) {",
            "if matches!(next, Place::NotBefore(_)) && broken!(what_may_still_come_is_ignored) { return Ok(best); }
            if matches!(next, Place::NotBefore(_)) {",
        )],
        promise: THREE,
    },
    Mistake {
        name: "a_silent_stream_is_guessed_around",
        edits: &[edit(
            "matcher.rs",
            "if let Some(stream) = (0..N).filter(lacks)",
            "if let Some(stream) = (0..N).filter(lacks).filter(|_| !broken!(a_silent_stream_is_guessed_around))",
        )],
        promise: SILENT,
    },
    Mistake {
        name: "losses_for_want_of_room_are_not_counted",
        edits: &[and_not("matcher.rs", "counts.no_room += u64::from(dropped.is_some()")],
        promise: SILENT,
    },
    Mistake {
        name: "what_is_passed_over_stays",
        edits: &[edit(
            "matcher.rs",
            "for _ in 0..before {",
            "for _ in 0..if broken!(what_is_passed_over_stays) { 0 } else { before } {",
        )],
        promise: TWO,
    },
];
