//! Mistakes in sleeping and waking.

use super::variant::{Broken, ENDLESS, FENCE_E, NO_FENCE_E, edit};

const DROWSY: &str = "        receivers.iter().for_each(|receiver| receiver.mailbox.slots().drowsy());\n";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- sleeping ----
    // Neither sees the other: the sender reads the old `sleeping`, the receiver the old hints.
    Broken {
        name: "no_fence_e",
        edits: &[edit("slots", FENCE_E, NO_FENCE_E)],
        caught_by: "no_wake_up_is_lost",
        says: ENDLESS,
    },
    Broken {
        name: "no_fence_f",
        edits: &[edit(
            "hot",
            "Pairs with (E).\n        seq_cst_accesses();\n    }\n\n    /// Says that the receiver does not sleep.",
            "Pairs with (E).\n    }\n\n    /// Says that the receiver does not sleep.",
        )],
        caught_by: "no_wake_up_is_lost",
        says: ENDLESS,
    },
    // Rung after the last look, the receiver sleeps on the rung bell.
    Broken {
        name: "bell_read_after_the_last_look",
        edits: &[
            edit("rig", "        let seen = bell.seen();\n", ""),
            edit("rig", "bell.may_poll(seen)", "bell.may_poll(bell.seen())"),
            edit("rig", "mailbox.sleep(seen);", "mailbox.sleep(bell.seen());"),
        ],
        caught_by: "no_wake_up_is_lost",
        says: ENDLESS,
    },
    // Published after the last look and before it says that it sleeps.
    Broken {
        name: "drowsy_after_the_last_look",
        edits: &[
            edit("rig", DROWSY, ""),
            edit(
                "rig",
                "                mailbox.sleep(seen);",
                "                mailbox.slots().drowsy();\n                mailbox.sleep(seen);",
            ),
        ],
        caught_by: "no_wake_up_is_lost",
        says: ENDLESS,
    },
    // The bell before the word `sleeping` is looked at: the receiver sleeps again between ring and clearing, and the
    // other sender sees it awake.
    Broken {
        name: "the_waker_clears_sleeping",
        edits: &[edit(
            "rig",
            "                    self.mailbox.ring();\n",
            "                    self.mailbox.ring();\n                    slots.awake();\n",
        )],
        caught_by: "no_wake_up_is_lost_between_two",
        says: ENDLESS,
    },
    // That of the displaced package has woken the receiver already, which then finds a slot that is being filled.
    Broken {
        name: "a_displacer_rings_nobody",
        edits: &[edit("slots", "let wake = rings(", "let wake = claim.victim().is_none() && rings(")],
        caught_by: "no_wake_up_is_lost_when_displaced",
        says: ENDLESS,
    },
    // ---- sleeping on several mailboxes ----
    Broken {
        name: "drowsy_in_one_mailbox_only",
        edits: &[edit("rig", DROWSY, "        receivers[0].mailbox.slots().drowsy();\n")],
        caught_by: "no_wake_up_is_lost_between_two_mailboxes",
        says: ENDLESS,
    },
    Broken {
        name: "looks_at_one_mailbox_only",
        edits: &[edit("rig", "!receivers.iter().any(found)", "!found(&receivers[0])")],
        caught_by: "no_wake_up_is_lost_between_two_mailboxes",
        says: ENDLESS,
    },
    // ---- sleeping in poll ----
    // Neither sees the other: the ringer reads the old `polling`, the sleeper the old rings.
    Broken {
        name: "no_fence_h",
        edits: &[edit("bell", "Pairs with (I).\n        fence(Ordering::SeqCst);\n", "Pairs with (I).\n")],
        caught_by: "no_wake_up_is_lost_in_poll",
        says: ENDLESS,
    },
    Broken {
        name: "no_fence_i",
        edits: &[edit("bell", "Pairs with (H).\n        fence(Ordering::SeqCst);\n", "Pairs with (H).\n")],
        caught_by: "no_wake_up_is_lost_in_poll",
        says: ENDLESS,
    },
    // Rung between the two: the ringer writes nothing, and the sleeper sleeps.
    Broken {
        name: "polls_before_it_says_so",
        edits: &[
            edit(
                "bell",
                "        self.polling.store(1, Ordering::Relaxed);\n",
                "        let quiet = self.rings.load(Ordering::Relaxed) == seen;\n        self.polling.store(1, \
                 Ordering::Relaxed);\n",
            ),
            edit("bell", "self.rings.load(Ordering::Relaxed) == seen\n    }", "quiet\n    }"),
        ],
        caught_by: "no_wake_up_is_lost_in_poll",
        says: ENDLESS,
    },
    // As for a futex, but there is no kernel that compares.
    Broken {
        name: "polls_without_comparing",
        edits: &[edit("bell", "self.rings.load(Ordering::Relaxed) == seen\n    }", "true\n    }")],
        caught_by: "no_wake_up_is_lost_in_poll",
        says: ENDLESS,
    },
    // To save the others the system call. A ringer that dies now takes along what the others would have written.
    Broken {
        name: "the_first_ringer_clears_polling",
        edits: &[edit(
            "bell",
            "step!(\"bell: rung\");\n        self.polling.load(Ordering::Relaxed) != 0",
            "let polling = self.polling.swap(0, Ordering::Relaxed) != 0;\n        step!(\"bell: rung\");\n        \
             polling",
        )],
        caught_by: "a_dead_ringer_takes_no_wake_up_along",
        says: ENDLESS,
    },
];
