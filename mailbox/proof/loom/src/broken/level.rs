//! Mistakes about the level, and the alert above it.

use super::variant::{Broken, FENCE_E, NO_FENCE_E, WRONG, edit};

const LOWER: &str =
    "            slots.lower_level(first);\n            self.level = first.0.into();\n            self.look(slots);\n";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- the level, and the alert above it ----
    Broken {
        name: "nobody_alerts",
        edits: &[edit("slots", "self.hot.alert.0.swap(1, Ordering::Release);", "")],
        caught_by: "the_urgent_passes_what_is_known",
        says: WRONG,
    },
    // The alert is seen, and not what it was for; and it is cleared.
    Broken {
        name: "alert_without_release",
        edits: &[
            edit(
                "slots",
                "self.hot.alert.0.swap(1, Ordering::Release);",
                "self.hot.alert.0.swap(1, Ordering::Relaxed);",
            ),
            edit("slots", FENCE_E, NO_FENCE_E),
        ],
        caught_by: "the_urgent_passes_what_is_known",
        says: WRONG,
    },
    Broken {
        name: "heed_without_acquire",
        edits: &[edit("hot", "alert.0.swap(0, Ordering::AcqRel)", "alert.0.swap(0, Ordering::Release)")],
        caught_by: "the_urgent_passes_what_is_known",
        says: WRONG,
    },
    // What was looked at before an alert was cleared says nothing about what the alert was for.
    Broken {
        name: "heeds_after_the_look",
        edits: &[edit(
            "queue",
            "        if slots.is_alerted() {\n            slots.heed();\n        }\n        self.look(slots);\n",
            "        self.look(slots);\n        if slots.is_alerted() {\n            slots.heed();\n        }\n",
        )],
        caught_by: "the_urgent_passes_what_is_known",
        says: WRONG,
    },
    // A sender that read the higher level did not alert, and is overlooked.
    Broken {
        name: "no_look_at_the_new_level",
        edits: &[edit(
            "queue",
            LOWER,
            "            slots.lower_level(first);\n            self.level = first.0.into();\n",
        )],
        caught_by: "what_comes_as_the_level_sinks_is_next",
        says: WRONG,
    },
    Broken {
        name: "the_new_level_is_said_after_the_look",
        edits: &[edit(
            "queue",
            LOWER,
            "            self.look(slots);\n            slots.lower_level(first);\n            self.level = \
             first.0.into();\n",
        )],
        caught_by: "what_comes_as_the_level_sinks_is_next",
        says: WRONG,
    },
    // Neither sees the other: the sender reads the old level, the receiver the old hints.
    Broken {
        name: "no_fence_j",
        edits: &[edit("hot", "did not alert.\n        seq_cst_accesses();\n", "did not alert.\n")],
        caught_by: "what_comes_as_the_level_sinks_is_next",
        says: WRONG,
    },
    Broken {
        name: "no_fence_e_at_the_level",
        edits: &[edit("slots", FENCE_E, NO_FENCE_E)],
        caught_by: "what_comes_as_the_level_sinks_is_next",
        says: WRONG,
    },
    // The dead one's level stands: senders below it keep silent.
    Broken {
        name: "a_successor_trusts_the_level",
        edits: &[
            edit("queue", "receives: 0, level: NO_LEVEL }", "receives: 0, level: 0 }"),
            edit("queue", "        self.level = NO_LEVEL;\n    }", "    }"),
        ],
        caught_by: "a_new_owner_says_its_own_level",
        says: WRONG,
    },
    // One alert in place of the other, and the hint that it was for is not seen. Only a sender that overwrites what it
    // has not read.
    Broken {
        name: "alerts_by_a_store",
        edits: &[edit(
            "slots",
            "self.hot.alert.0.swap(1, Ordering::Release);",
            "self.hot.alert.0.store(1, Ordering::Release);",
        )],
        caught_by: "two_alerts_are_two",
        says: "passed",
    },
    // To save the others the cache line. What is read may be the alert that was heeded already.
    Broken {
        name: "alerts_unless_alerted",
        edits: &[edit(
            "slots",
            "self.hot.alert.0.swap(1, Ordering::Release);",
            "if self.hot.alert.0.load(Ordering::Relaxed) == 0 { self.hot.alert.0.swap(1, Ordering::Release); }",
        )],
        caught_by: "two_alerts_are_two",
        says: "passed",
    },
    // A state raised to the level, and older than what is known of the level.
    Broken {
        name: "what_moved_alerts_nobody",
        edits: &[edit(
            "slots",
            "u32::from(priority.0) + u32::from(moved) > receiver",
            "u32::from(priority.0) > receiver",
        )],
        caught_by: "a_state_raised_to_the_level_is_found",
        says: WRONG,
    },
    // It has hinted, and nobody looks.
    Broken {
        name: "a_death_raises_no_doubt",
        edits: &[edit("queue", "        self.level = NO_LEVEL;\n    }", "    }")],
        caught_by: "a_sender_that_dies_before_its_alert_is_heard",
        says: WRONG,
    },
    // The state's newer package waits until all that was known has been received.
    Broken {
        name: "no_look_after_a_miss",
        edits: &[edit("queue", "            known = false;\n", "")],
        caught_by: "the_newest_is_found_in_its_place",
        says: WRONG,
    },
    // The rank without the priority.
    Broken {
        name: "first_come_first_served",
        edits: &[edit(
            "word",
            "(self.priority().0 as u64) << RANK | (TICKET - self.ticket())",
            "TICKET - self.ticket()",
        )],
        caught_by: "the_more_important_goes_first",
        says: WRONG,
    },
];
