//! Mistakes about the level, and the alert above it.

use super::variant::{Broken, FENCE_E, NO_FENCE_E, WRONG, broken, edit};

const LOWER: &str =
    "            slots.lower_level(first);\n            self.level = first.0.into();\n            self.look(slots);\n";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- the level, and the alert above it ----
    broken(
        "nobody_alerts",
        &[edit("slots/protocol", "self.hot.alert.0.swap(1, Ordering::Release);", "")],
        "the_urgent_passes_what_is_known",
        WRONG,
    ),
    // The alert is seen, and not what it was for; and it is cleared.
    broken(
        "alert_without_release",
        &[
            edit(
                "slots/protocol",
                "self.hot.alert.0.swap(1, Ordering::Release);",
                "self.hot.alert.0.swap(1, Ordering::Relaxed);",
            ),
            edit("slots/protocol", FENCE_E, NO_FENCE_E),
        ],
        "the_urgent_passes_what_is_known",
        WRONG,
    ),
    broken(
        "heed_without_acquire",
        &[edit("slots/hot", "alert.0.swap(0, Ordering::AcqRel)", "alert.0.swap(0, Ordering::Release)")],
        "the_urgent_passes_what_is_known",
        WRONG,
    ),
    // What was looked at before an alert was cleared says nothing about what the alert was for.
    broken(
        "heeds_after_the_look",
        &[edit(
            "slots/queue",
            "        if slots.is_alerted() {\n            slots.heed();\n        }\n        self.look(slots);\n",
            "        self.look(slots);\n        if slots.is_alerted() {\n            slots.heed();\n        }\n",
        )],
        "the_urgent_passes_what_is_known",
        WRONG,
    ),
    // A sender that read the higher level did not alert, and is overlooked.
    broken(
        "no_look_at_the_new_level",
        &[edit(
            "slots/queue",
            LOWER,
            "            slots.lower_level(first);\n            self.level = first.0.into();\n",
        )],
        "what_comes_as_the_level_sinks_is_next",
        WRONG,
    ),
    broken(
        "the_new_level_is_said_after_the_look",
        &[edit(
            "slots/queue",
            LOWER,
            "            self.look(slots);\n            slots.lower_level(first);\n            self.level = \
             first.0.into();\n",
        )],
        "what_comes_as_the_level_sinks_is_next",
        WRONG,
    ),
    // Neither sees the other: the sender reads the old level, the receiver the old hints.
    broken(
        "no_fence_j",
        &[edit("slots/hot", "did not alert.\n        seq_cst_accesses();\n", "did not alert.\n")],
        "what_comes_as_the_level_sinks_is_next",
        WRONG,
    ),
    broken(
        "no_fence_e_at_the_level",
        &[edit("slots/protocol", FENCE_E, NO_FENCE_E)],
        "what_comes_as_the_level_sinks_is_next",
        WRONG,
    ),
    // The dead one's level stands: senders below it keep silent.
    broken(
        "a_successor_trusts_the_level",
        &[
            edit("slots/queue", "receives: 0, level: NO_LEVEL }", "receives: 0, level: 0 }"),
            edit("slots/queue", "        self.level = NO_LEVEL;\n    }", "    }"),
        ],
        "a_new_owner_says_its_own_level",
        WRONG,
    ),
    // One alert in place of the other, and the hint that it was for is not seen. Only a sender that overwrites what it
    // has not read.
    broken(
        "alerts_by_a_store",
        &[edit(
            "slots/protocol",
            "self.hot.alert.0.swap(1, Ordering::Release);",
            "self.hot.alert.0.store(1, Ordering::Release);",
        )],
        "two_alerts_are_two",
        "passed",
    ),
    // To save the others the cache line. What is read may be the alert that was heeded already.
    broken(
        "alerts_unless_alerted",
        &[edit(
            "slots/protocol",
            "self.hot.alert.0.swap(1, Ordering::Release);",
            "if self.hot.alert.0.load(Ordering::Relaxed) == 0 { self.hot.alert.0.swap(1, Ordering::Release); }",
        )],
        "two_alerts_are_two",
        "passed",
    ),
    // A state raised to the level, and older than what is known of the level.
    broken(
        "what_moved_alerts_nobody",
        &[edit(
            "slots/protocol",
            "u32::from(priority.0) + u32::from(moved) > receiver",
            "u32::from(priority.0) > receiver",
        )],
        "a_state_raised_to_the_level_is_found",
        WRONG,
    ),
    // It has hinted, and nobody looks.
    broken(
        "a_death_raises_no_doubt",
        &[edit("slots/queue", "        self.level = NO_LEVEL;\n    }", "    }")],
        "a_sender_that_dies_before_its_alert_is_heard",
        WRONG,
    ),
    // The state's newer package waits until all that was known has been received.
    broken(
        "no_look_after_a_miss",
        &[edit("slots/queue", "            known = false;\n", "")],
        "the_newest_is_found_in_its_place",
        WRONG,
    ),
    // The rank without the priority.
    broken(
        "first_come_first_served",
        &[edit(
            "slots/word",
            "(self.priority().0 as u64) << RANK | (TICKET - self.ticket())",
            "TICKET - self.ticket()",
        )],
        "the_more_important_goes_first",
        WRONG,
    ),
];
