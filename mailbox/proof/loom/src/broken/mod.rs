//! The models' names, and the variants of the slot core that must fail in one of them.

mod ending;
mod level;
mod order;
mod room;
mod variant;
mod wake;

pub(crate) use variant::{Broken, ENDLESS, Edit, RACE, broken};

/// Each model and the bound on its preemptions: how often loom may take the processor from a thread that could go on.
pub(crate) const MODELS: &[(&str, usize)] = &[
    ("a_body_is_handed_over_whole", 3),
    ("everything_arrives_once_and_in_order", 2),
    ("a_second_package_never_passes_the_first", 3),
    ("publishing_gives_the_order", 3),
    ("the_more_important_goes_first", 2),
    ("the_urgent_passes_what_is_known", 2),
    ("what_comes_as_the_level_sinks_is_next", 2),
    ("a_new_owner_says_its_own_level", 2),
    ("a_sender_that_dies_before_its_alert_is_heard", 2),
    ("two_alerts_are_two", 1),
    ("a_state_raised_to_the_level_is_found", 1),
    ("the_newest_is_found_in_its_place", 1),
    ("a_displaced_package_is_counted_and_not_received", 2),
    ("displacing_keeps_the_order", 2),
    ("a_sender_that_outranks_all_is_not_refused", 3),
    ("two_displace_two", 3),
    ("the_newest_replaces_what_waits", 2),
    ("the_newest_reuses_the_only_slot", 2),
    ("the_newest_keeps_its_place", 2),
    ("a_word_comes_back_with_the_newer_package", 3),
    ("a_displaced_package_is_not_replaced_too", 2),
    ("a_retired_mailbox_counts_the_replaced", 3),
    ("no_wake_up_is_lost", 3),
    ("no_wake_up_is_lost_between_two", 2),
    ("no_wake_up_is_lost_when_displaced", 2),
    ("no_wake_up_is_lost_in_poll", 2),
    ("a_dead_ringer_takes_no_wake_up_along", 2),
    ("no_wake_up_is_lost_between_two_mailboxes", 2),
    ("a_retired_mailbox_keeps_nothing", 3),
    ("a_retired_mailbox_keeps_nothing_of_the_dead", 2),
    ("a_retired_mailbox_counts_the_displaced", 3),
    ("a_replaced_mailbox_hides_no_loss", 3),
    ("a_replaced_mailbox_hides_no_late_loss", 2),
    ("a_sender_dies_with_a_claim", 2),
    ("a_sender_dies_with_a_ticket", 2),
    ("a_sender_dies_without_its_hint", 2),
    ("a_displacer_dies", 2),
    ("a_replacer_dies_before_the_old_one_goes", 2),
    ("a_replacer_dies_when_the_old_one_is_gone", 2),
    ("a_replacer_dies_in_the_only_slot", 2),
    ("a_package_without_hint_is_found_in_turn", 3),
    ("a_package_in_dead_hands_is_delivered_once_more", 2),
];

/// All variants, by what they are about.
pub(crate) const BROKEN: &[&[Broken]] = &[order::BROKEN, level::BROKEN, room::BROKEN, wake::BROKEN, ending::BROKEN];
