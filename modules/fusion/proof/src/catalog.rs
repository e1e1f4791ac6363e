//! The mistakes, each with the promise that it breaks. `broken!` asks whether its mistake is made.

use rohrpost_planted::{Mistake, and_not, edit, instead, left_out, mistake, or};

const FINAL: &str = "lookups::answers_are_right_and_final_in_each_order_of_arrival";
const REASONS: &str = "lookups::each_reason_says_how_far";
const RATE: &str = "interpolation::rotations_turn_at_a_constant_rate_the_short_way";
const OPPOSITE: &str = "interpolation::opposite_headings_and_rotations_turn_one_way";
const TWO: &str = "matching::two_streams_are_joined_as_the_definition_says";
const THREE: &str = "matching::three_streams_are_joined_as_the_definition_says";
const SILENT: &str = "matching::a_silent_stream_is_named_and_memory_stays_bounded";

pub(crate) const MISTAKES: &[Mistake] = &[
    // ---- values in between ----
    mistake(
        "headings_turn_the_long_way",
        &[instead("interpolate.rs", "wrap_rad(to - from)", "to - from")],
        "interpolation::a_heading_crosses_the_seam",
    ),
    mistake(
        "values_are_extrapolated",
        &[and_not("interpolate.rs", "if gone_ns > whole_ns")],
        "interpolation::no_share_lies_outside",
    ),
    mistake(
        "the_later_value_is_the_nearer_one",
        &[edit(
            "interpolate.rs",
            "if self.0 > 0.5 {",
            "if self.0 > 0.5 || broken!(the_later_value_is_the_nearer_one) && self.0 > 0.0 {",
        )],
        "interpolation::each_field_goes_its_own_way",
    ),
    mistake(
        "half_turns_go_clockwise",
        &[edit("angle.rs", "if turned > PI {", "if turned > PI || broken!(half_turns_go_clockwise) && turned >= PI {")],
        OPPOSITE,
    ),
    mistake("rotations_turn_the_long_way", &[and_not("nalgebra_types.rs", "if cosine < 0.0")], RATE),
    mistake(
        "half_turns_depend_on_the_quaternion",
        &[and_not("nalgebra_types.rs", "(cosine == 0.0 && points_back()")],
        OPPOSITE,
    ),
    // Straight through the sphere, then out to it: quick in the middle.
    mistake(
        "rotations_go_straight",
        &[edit(
            "nalgebra_types.rs",
            "let half_rad = share.get() * sine.atan2(cosine);",
            "let gone = share.get();
        let straight_rad = (gone * sine).atan2(1.0 - gone + gone * cosine);
        let half_rad = if broken!(rotations_go_straight) { straight_rad } else { gone * sine.atan2(cosine) };",
        )],
        RATE,
    ),
    // ---- the order of a stream ----
    mistake(
        "records_stand_as_they_come",
        &[edit(
            "sorted.rs",
            "let mut left = None;",
            "let mut left = None;
        if broken!(records_stand_as_they_come) { at = self.records.len(); }",
        )],
        FINAL,
    ),
    mistake(
        "numbers_do_not_order_equal_stamps",
        &[instead("sorted.rs", "(known.stamp, known.sequence) < key", "known.stamp <= key.0")],
        FINAL,
    ),
    mistake("late_records_are_taken", &[and_not("sorted.rs", "if by_ns > 0 && by_ns >= self.lateness_ns")], REASONS),
    mistake("records_of_an_earlier_epoch_are_taken", &[and_not("sorted.rs", "if stamp.epoch < newest.epoch")], REASONS),
    mistake(
        "records_settle_too_early",
        &[edit(
            "sorted.rs",
            "|by_ns| by_ns >= self.lateness_ns)",
            "|by_ns| by_ns + if broken!(records_settle_too_early) { 2 } else { 0 } >= self.lateness_ns)",
        )],
        "matching::a_set_waits_for_a_better_record_that_may_still_come",
    ),
    mistake("memory_has_no_bound", &[and_not("sorted.rs", "if self.records.len() == self.capacity")], SILENT),
    mistake("epochs_are_put_together", &[left_out("history.rs", "self.sorted.clear();")], REASONS),
    // ---- lookups ----
    mistake(
        "the_record_after_may_be_open",
        &[edit(
            "lookup.rs",
            "settled(after_ns)?;",
            "settled(if broken!(the_record_after_may_be_open) { stamp.ns } else { after_ns })?;",
        )],
        FINAL,
    ),
    mistake("gaps_are_bridged", &[and_not("lookup.rs", "if gap_ns > gap_max_ns")], REASONS),
    mistake("another_epoch_is_asked", &[and_not("lookup.rs", "if stamp.epoch != known")], REASONS),
    mistake(
        "the_first_of_a_stamp_answers",
        &[and_not("lookup.rs", "Some(next_ns) if next_ns == after_ns")],
        "lookups::without_lateness_the_newest_record_answers_at_once",
    ),
    mistake(
        "what_is_forgotten_is_empty",
        &[edit(
            "lookup.rs",
            "oldest_ns.map_or(NoValue::Empty,",
            "oldest_ns.filter(|_| !broken!(what_is_forgotten_is_empty)).map_or(NoValue::Empty,",
        )],
        "lookups::what_is_overwritten_during_a_lookup_is_forgotten",
    ),
    // ---- sets ----
    mistake(
        "sets_are_too_large",
        &[edit(
            "matcher.rs",
            "apart_ns > self.tolerance_ns",
            "apart_ns > self.tolerance_ns + if broken!(sets_are_too_large) { 1 } else { 0 }",
        )],
        TWO,
    ),
    mistake(
        "sets_have_records_of_two_epochs",
        &[edit(
            "matcher.rs",
            "latest.since(first).is_none_or(",
            "latest.since(first).map_or(!broken!(sets_have_records_of_two_epochs), ",
        )],
        TWO,
    ),
    mistake("the_first_set_is_taken", &[or("matcher.rs", "if start >= pivot")], TWO),
    mistake(
        "of_equal_sets_the_last_is_taken",
        &[edit(
            "matcher.rs",
            "if size_ns < least_ns {",
            "if size_ns < least_ns || broken!(of_equal_sets_the_last_is_taken) && size_ns == least_ns {",
        )],
        TWO,
    ),
    // A later set may be smaller, and leaves out one that could have been formed before it.
    mistake(
        "the_search_passes_the_pivot",
        &[edit(
            "matcher.rs",
            "let pivot = latest(&stamps);",
            "let mut pivot = latest(&stamps);
        if broken!(the_search_passes_the_pivot) { pivot.ns += 3; }",
        )],
        TWO,
    ),
    mistake(
        "what_may_still_come_is_ignored",
        &[edit(
            "matcher.rs",
            "if matches!(next, Place::NotBefore(_)) {",
            "if matches!(next, Place::NotBefore(_)) && broken!(what_may_still_come_is_ignored) { return Ok(best); }
            if matches!(next, Place::NotBefore(_)) {",
        )],
        THREE,
    ),
    mistake(
        "a_silent_stream_is_guessed_around",
        &[edit(
            "matcher.rs",
            "if let Some(stream) = (0..N).filter(lacks)",
            "if let Some(stream) = (0..N).filter(lacks).filter(|_| !broken!(a_silent_stream_is_guessed_around))",
        )],
        SILENT,
    ),
    mistake(
        "losses_for_want_of_room_are_not_counted",
        &[and_not("matcher.rs", "counts.no_room += u64::from(dropped.is_some()")],
        SILENT,
    ),
    mistake(
        "what_is_passed_over_stays",
        &[edit(
            "matcher.rs",
            "for _ in 0..before {",
            "for _ in 0..if broken!(what_is_passed_over_stays) { 0 } else { before } {",
        )],
        TWO,
    ),
];
