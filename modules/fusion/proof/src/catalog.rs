//! The mistakes, each with the promise that it breaks. `broken!` asks whether its mistake is made.

/// A mistake that one could make: a change of a source. `from` must be there exactly once.
pub(crate) struct Mistake {
    pub(crate) name: &'static str,
    /// Without `.rs`.
    pub(crate) file: &'static str,
    pub(crate) from: &'static str,
    pub(crate) to: &'static str,
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
        file: "interpolate",
        from: "wrap_rad(from + share.get() * wrap_rad(to - from))",
        to: "wrap_rad(from + share.get() * if broken!(headings_turn_the_long_way) { to - from } \
             else { wrap_rad(to - from) })",
        promise: "interpolation::a_heading_crosses_the_seam",
    },
    Mistake {
        name: "values_are_extrapolated",
        file: "interpolate",
        from: "if gone_ns > whole_ns {",
        to: "if gone_ns > whole_ns && !broken!(values_are_extrapolated) {",
        promise: "interpolation::no_share_lies_outside",
    },
    Mistake {
        name: "the_later_value_is_the_nearer_one",
        file: "interpolate",
        from: "if self.0 > 0.5 {",
        to: "if self.0 > 0.5 || broken!(the_later_value_is_the_nearer_one) && self.0 > 0.0 {",
        promise: "interpolation::each_field_goes_its_own_way",
    },
    Mistake {
        name: "half_turns_go_clockwise",
        file: "angle",
        from: "if turned > PI {",
        to: "if turned > PI || broken!(half_turns_go_clockwise) && turned >= PI {",
        promise: OPPOSITE,
    },
    Mistake {
        name: "rotations_turn_the_long_way",
        file: "nalgebra_types",
        from: "if cosine < 0.0 ||",
        to: "if cosine < 0.0 && !broken!(rotations_turn_the_long_way) ||",
        promise: RATE,
    },
    Mistake {
        name: "half_turns_depend_on_the_quaternion",
        file: "nalgebra_types",
        from: "(cosine == 0.0 && points_back())",
        to: "(cosine == 0.0 && points_back() && !broken!(half_turns_depend_on_the_quaternion))",
        promise: OPPOSITE,
    },
    // Straight through the sphere, then out to it: quick in the middle.
    Mistake {
        name: "rotations_go_straight",
        file: "nalgebra_types",
        from: "let half_rad = share.get() * sine.atan2(cosine);",
        to: "let gone = share.get();
        let straight_rad = (gone * sine).atan2(1.0 - gone + gone * cosine);
        let half_rad = if broken!(rotations_go_straight) { straight_rad } else { gone * sine.atan2(cosine) };",
        promise: RATE,
    },
    // ---- the order of a stream ----
    Mistake {
        name: "records_stand_as_they_come",
        file: "sorted",
        from: "let mut left = None;",
        to: "let mut left = None;
        if broken!(records_stand_as_they_come) { at = self.records.len(); }",
        promise: FINAL,
    },
    Mistake {
        name: "numbers_do_not_order_equal_stamps",
        file: "sorted",
        from: "(known.stamp, known.sequence) < key",
        to: "if broken!(numbers_do_not_order_equal_stamps) { known.stamp <= key.0 } \
             else { (known.stamp, known.sequence) < key }",
        promise: FINAL,
    },
    Mistake {
        name: "late_records_are_taken",
        file: "sorted",
        from: "if by_ns > 0 && by_ns >= self.lateness_ns {",
        to: "if by_ns > 0 && by_ns >= self.lateness_ns && !broken!(late_records_are_taken) {",
        promise: REASONS,
    },
    Mistake {
        name: "records_of_an_earlier_epoch_are_taken",
        file: "sorted",
        from: "if stamp.epoch < newest.epoch {",
        to: "if stamp.epoch < newest.epoch && !broken!(records_of_an_earlier_epoch_are_taken) {",
        promise: REASONS,
    },
    Mistake {
        name: "records_settle_too_early",
        file: "sorted",
        from: "|by_ns| by_ns >= self.lateness_ns)",
        to: "|by_ns| by_ns + if broken!(records_settle_too_early) { 2 } else { 0 } >= self.lateness_ns)",
        promise: "matching::a_set_waits_for_a_better_record_that_may_still_come",
    },
    Mistake {
        name: "memory_has_no_bound",
        file: "sorted",
        from: "if self.records.len() == self.capacity {",
        to: "if self.records.len() == self.capacity && !broken!(memory_has_no_bound) {",
        promise: SILENT,
    },
    Mistake {
        name: "epochs_are_put_together",
        file: "history",
        from: "self.sorted.clear();",
        to: "if !broken!(epochs_are_put_together) { self.sorted.clear(); }",
        promise: REASONS,
    },
    // ---- lookups ----
    Mistake {
        name: "the_record_after_may_be_open",
        file: "lookup",
        from: "settled(after_ns)?;",
        to: "settled(if broken!(the_record_after_may_be_open) { stamp.ns } else { after_ns })?;",
        promise: FINAL,
    },
    Mistake {
        name: "gaps_are_bridged",
        file: "lookup",
        from: "if gap_ns > gap_max_ns {",
        to: "if gap_ns > gap_max_ns && !broken!(gaps_are_bridged) {",
        promise: REASONS,
    },
    Mistake {
        name: "another_epoch_is_asked",
        file: "lookup",
        from: "if stamp.epoch != known {",
        to: "if stamp.epoch != known && !broken!(another_epoch_is_asked) {",
        promise: REASONS,
    },
    Mistake {
        name: "the_first_of_a_stamp_answers",
        file: "lookup",
        from: "Some(next_ns) if next_ns == after_ns",
        to: "Some(next_ns) if next_ns == after_ns && !broken!(the_first_of_a_stamp_answers)",
        promise: "lookups::without_lateness_the_newest_record_answers_at_once",
    },
    Mistake {
        name: "what_is_forgotten_is_empty",
        file: "lookup",
        from: "oldest_ns.map_or(NoValue::Empty,",
        to: "oldest_ns.filter(|_| !broken!(what_is_forgotten_is_empty)).map_or(NoValue::Empty,",
        promise: "lookups::what_is_overwritten_during_a_lookup_is_forgotten",
    },
    // ---- sets ----
    Mistake {
        name: "sets_are_too_large",
        file: "matcher",
        from: "apart_ns > self.tolerance_ns",
        to: "apart_ns > self.tolerance_ns + if broken!(sets_are_too_large) { 1 } else { 0 }",
        promise: TWO,
    },
    Mistake {
        name: "sets_have_records_of_two_epochs",
        file: "matcher",
        from: "latest.since(first).is_none_or(",
        to: "latest.since(first).map_or(!broken!(sets_have_records_of_two_epochs), ",
        promise: TWO,
    },
    Mistake {
        name: "the_first_set_is_taken",
        file: "matcher",
        from: "if start >= pivot {",
        to: "if start >= pivot || broken!(the_first_set_is_taken) {",
        promise: TWO,
    },
    Mistake {
        name: "of_equal_sets_the_last_is_taken",
        file: "matcher",
        from: "if size_ns < least_ns {",
        to: "if size_ns < least_ns || broken!(of_equal_sets_the_last_is_taken) && size_ns == least_ns {",
        promise: TWO,
    },
    // A later set may be smaller, and leaves out one that could have been formed before it.
    Mistake {
        name: "the_search_passes_the_pivot",
        file: "matcher",
        from: "let pivot = latest(&stamps);",
        to: "let mut pivot = latest(&stamps);
        if broken!(the_search_passes_the_pivot) { pivot.ns += 3; }",
        promise: TWO,
    },
    Mistake {
        name: "what_may_still_come_is_ignored",
        file: "matcher",
        from: "if matches!(next, Place::NotBefore(_)) {",
        to: "if matches!(next, Place::NotBefore(_)) && broken!(what_may_still_come_is_ignored) { return Ok(best); }
            if matches!(next, Place::NotBefore(_)) {",
        promise: THREE,
    },
    Mistake {
        name: "a_silent_stream_is_guessed_around",
        file: "matcher",
        from: "if let Some(stream) = (0..N).filter(lacks)",
        to: "if let Some(stream) = (0..N).filter(lacks).filter(|_| !broken!(a_silent_stream_is_guessed_around))",
        promise: SILENT,
    },
    Mistake {
        name: "losses_for_want_of_room_are_not_counted",
        file: "matcher",
        from: "counts.no_room += u64::from(dropped.is_some())",
        to: "counts.no_room += u64::from(dropped.is_some() && !broken!(losses_for_want_of_room_are_not_counted))",
        promise: SILENT,
    },
    Mistake {
        name: "what_is_passed_over_stays",
        file: "matcher",
        from: "for _ in 0..before {",
        to: "for _ in 0..if broken!(what_is_passed_over_stays) { 0 } else { before } {",
        promise: TWO,
    },
];
