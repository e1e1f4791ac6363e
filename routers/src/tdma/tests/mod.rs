//! The table by properties, the scheduler by scenes; each planted mistake must fail one of the checks.

mod arithmetic;
mod overheard;
mod scenes;
mod single;
mod tables;
mod world;

use crate::broken::{Broken, with};

/// Checks that hold; with each mistake one of them fails.
const CHECKS: [fn(); 16] = [
    arithmetic::windows_end_where_their_guard_begins,
    single::what_is_late_is_not_sent,
    single::silence_begins_right_above_the_allowance,
    single::no_frame_starts_before_its_slot,
    single::what_was_handed_over_counts,
    single::a_replacement_is_a_sign_of_life_and_nothing_else,
    single::a_node_that_turns_while_the_first_master_lives_is_not_sure,
    scenes::nodes_join_one_by_one_and_never_meet,
    scenes::a_master_dies_and_no_slot_is_lost,
    scenes::a_master_of_which_two_syncs_are_missing_remains_it,
    scenes::two_masters_become_one,
    overheard::a_hello_leaves_in_one_of_four_cycles_and_nothing_else,
    overheard::a_node_that_hears_unverified_frames_begins_no_time_for_a_while,
    overheard::a_new_master_steps_back_until_patience_is_over,
    tables::a_node_with_an_edited_file_beside_others_sends_nothing,
    tables::of_two_tables_that_meet_one_goes_on,
];

#[test]
fn all_checks_hold() {
    CHECKS.into_iter().for_each(|check| check());
}

#[test]
fn every_mistake_is_noticed() {
    let mut missed = Vec::new();
    for broken in Broken::SLOTS.into_iter().chain(Broken::UNPROVEN).chain(Broken::TABLES) {
        let notices = |check: &fn()| with(broken, || std::panic::catch_unwind(check).is_err());
        if !CHECKS.iter().any(notices) {
            missed.push(broken);
        }
    }
    assert_eq!(missed, []);
}
