//! Mistakes in sleeping and waking.

use super::variant::{Broken, ENDLESS, FENCE_E, NO_FENCE_E, broken, edit};

const DROWSY: &str = "        receivers.iter().for_each(|receiver| receiver.mailbox.slots().drowsy());\n";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- sleeping ----
    // Neither sees the other: the sender reads the old `sleeping`, the receiver the old hints.
    broken("no_fence_e", &[edit("slots/protocol", FENCE_E, NO_FENCE_E)], "no_wake_up_is_lost", ENDLESS),
    broken(
        "no_fence_f",
        &[edit(
            "slots/hot",
            "Pairs with (E).\n        seq_cst_accesses();\n    }\n\n    /// Says that the receiver does not sleep.",
            "Pairs with (E).\n    }\n\n    /// Says that the receiver does not sleep.",
        )],
        "no_wake_up_is_lost",
        ENDLESS,
    ),
    // Rung after the last look, the receiver sleeps on the rung bell.
    broken(
        "bell_read_after_the_last_look",
        &[
            edit("rig", "        let seen = bell.seen();\n", ""),
            edit("rig", "bell.may_poll(seen)", "bell.may_poll(bell.seen())"),
            edit("rig", "mailbox.sleep(seen);", "mailbox.sleep(bell.seen());"),
        ],
        "no_wake_up_is_lost",
        ENDLESS,
    ),
    // Published after the last look and before it says that it sleeps.
    broken(
        "drowsy_after_the_last_look",
        &[
            edit("rig", DROWSY, ""),
            edit(
                "rig",
                "                mailbox.sleep(seen);",
                "                mailbox.slots().drowsy();\n                mailbox.sleep(seen);",
            ),
        ],
        "no_wake_up_is_lost",
        ENDLESS,
    ),
    // The bell before the word `sleeping` is looked at: the receiver sleeps again between ring and clearing, and the
    // other sender sees it awake.
    broken(
        "the_waker_clears_sleeping",
        &[edit(
            "rig",
            "                    self.mailbox.ring();\n",
            "                    self.mailbox.ring();\n                    slots.awake();\n",
        )],
        "no_wake_up_is_lost_between_two",
        ENDLESS,
    ),
    // That of the displaced package has woken the receiver already, which then finds a slot that is being filled.
    broken(
        "a_displacer_rings_nobody",
        &[edit("slots/protocol", "let wake = rings(", "let wake = claim.victim().is_none() && rings(")],
        "no_wake_up_is_lost_when_displaced",
        ENDLESS,
    ),
    // ---- sleeping on several mailboxes ----
    broken(
        "drowsy_in_one_mailbox_only",
        &[edit("rig", DROWSY, "        receivers[0].mailbox.slots().drowsy();\n")],
        "no_wake_up_is_lost_between_two_mailboxes",
        ENDLESS,
    ),
    broken(
        "looks_at_one_mailbox_only",
        &[edit("rig", "!receivers.iter().any(found)", "!found(&receivers[0])")],
        "no_wake_up_is_lost_between_two_mailboxes",
        ENDLESS,
    ),
    // ---- sleeping in poll ----
    // Neither sees the other: the ringer reads the old `polling`, the sleeper the old rings.
    broken(
        "no_fence_h",
        &[edit("wake/bell", "Pairs with (I).\n        fence(Ordering::SeqCst);\n", "Pairs with (I).\n")],
        "no_wake_up_is_lost_in_poll",
        ENDLESS,
    ),
    broken(
        "no_fence_i",
        &[edit("wake/bell", "Pairs with (H).\n        fence(Ordering::SeqCst);\n", "Pairs with (H).\n")],
        "no_wake_up_is_lost_in_poll",
        ENDLESS,
    ),
    // Rung between the two: the ringer writes nothing, and the sleeper sleeps.
    broken(
        "polls_before_it_says_so",
        &[
            edit(
                "wake/bell",
                "        self.polling.store(1, Ordering::Relaxed);\n",
                "        let quiet = self.rings.load(Ordering::Relaxed) == seen;\n        self.polling.store(1, \
                 Ordering::Relaxed);\n",
            ),
            edit("wake/bell", "self.rings.load(Ordering::Relaxed) == seen\n    }", "quiet\n    }"),
        ],
        "no_wake_up_is_lost_in_poll",
        ENDLESS,
    ),
    // As for a futex, but there is no kernel that compares.
    broken(
        "polls_without_comparing",
        &[edit("wake/bell", "self.rings.load(Ordering::Relaxed) == seen\n    }", "true\n    }")],
        "no_wake_up_is_lost_in_poll",
        ENDLESS,
    ),
    // To save the others the system call. A ringer that dies now takes along what the others would have written.
    broken(
        "the_first_ringer_clears_polling",
        &[edit(
            "wake/bell",
            "step!(\"bell: rung\");\n        self.polling.load(Ordering::Relaxed) != 0",
            "let polling = self.polling.swap(0, Ordering::Relaxed) != 0;\n        step!(\"bell: rung\");\n        \
             polling",
        )],
        "a_dead_ringer_takes_no_wake_up_along",
        ENDLESS,
    ),
];
