//! The models' names, and the variants of the slot core that must fail in one of them.

/// Each model and the bound on its preemptions: how often loom may take the processor from a thread that could go on.
pub(crate) const MODELS: &[(&str, usize)] = &[
    ("a_body_is_handed_over_whole", 3),
    ("everything_arrives_once_and_in_order", 2),
    ("a_second_package_never_passes_the_first", 3),
    ("publishing_gives_the_order", 3),
    ("the_more_important_goes_first", 2),
    ("the_urgent_passes_what_is_known", 2),
    ("what_comes_as_the_level_sinks_is_next", 2),
    ("no_alert_is_lost", 1),
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
    ("no_wake_up_is_lost_in_poll_between_two", 1),
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
    ("a_sender_dies_after_its_hint", 2),
    ("a_displacer_dies", 2),
    ("a_replacer_dies_before_the_old_one_goes", 2),
    ("a_replacer_dies_when_the_old_one_is_gone", 2),
    ("a_replacer_dies_in_the_only_slot", 2),
    ("a_package_without_hint_is_found_in_turn", 3),
    ("a_package_in_dead_hands_is_delivered_once_more", 2),
];

/// A change of the real source. `from` must be there exactly once, so that a variant cannot rot unseen.
pub(crate) struct Edit {
    pub(crate) file: &'static str,
    pub(crate) from: &'static str,
    pub(crate) to: &'static str,
}

const fn edit(file: &'static str, from: &'static str, to: &'static str) -> Edit {
    Edit { file, from, to }
}

/// A mistake that one could make.
pub(crate) struct Broken {
    pub(crate) name: &'static str,
    pub(crate) edits: &'static [Edit],
    /// The model that fails.
    pub(crate) caught_by: &'static str,
    /// What the failure says.
    pub(crate) says: &'static str,
}

/// Two threads touch a body, and nothing orders them.
const RACE: &str = "Causality violation";
/// A promise was not kept.
const WRONG: &str = "assertion";
/// The receiver sleeps for ever: nobody will ring.
const ENDLESS: &str = "maximum number of branches";

const FENCE_E: &str = "turns to less important packages likewise.\n        seq_cst_accesses();\n";
const NO_FENCE_E: &str = "turns to less important packages likewise.\n";
/// Every look is one with a horizon, as after a first one that senders were quicker than.
const ONLY_WITH_HORIZON: Edit = edit(
    "queue",
    "        self.collect(slots, u64::MAX);\n        // ORDERING: the words",
    "        // ORDERING: the words",
);
const WITHOUT_RETURN: Edit = edit("queue", "        if !slots.any_hint() {\n            return;\n        }\n", "");

const DROWSY: &str = "        receivers.iter().for_each(|receiver| receiver.mailbox.slots().drowsy());\n";
const LOWER: &str =
    "            slots.lower_level(first);\n            self.level = first.0.into();\n            self.look(slots);\n";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- the word hands the body over: (A) to (D) ----
    // The important sender's write of the body races with that of the unimportant one, which it displaces.
    Broken {
        name: "publish_without_release",
        edits: &[edit(
            "slots",
            "if !self.change(slot, claim.word, word) {",
            "if self.word(slot).compare_exchange(claim.word.0, word.0, Ordering::Acquire, Ordering::Relaxed).is_err() \
             {",
        )],
        caught_by: "a_displaced_package_is_counted_and_not_received",
        says: RACE,
    },
    // The receiver loses packages or reads a body while its sender writes it, whichever loom meets first. All of them
    // must go for a race on the body: the hint's Acquire or the ticket counter's, which are there for other reasons,
    // hands the body over as well as the word's.
    Broken {
        name: "receiver_without_acquire",
        edits: &[
            edit(
                "slots",
                "self.change(slot, seen, word).then_some",
                "self.word(slot).compare_exchange(seen.0, word.0, Ordering::Release, \
                 Ordering::Relaxed).is_ok().then_some",
            ),
            edit(
                "slots",
                "Word(self.word(slot).load(Ordering::Acquire))",
                "Word(self.word(slot).load(Ordering::Relaxed))",
            ),
            edit("queue", "ticket.0.load(Ordering::Acquire)", "ticket.0.load(Ordering::Relaxed)"),
            edit("queue", "hints.swap(0, Ordering::AcqRel)", "hints.swap(0, Ordering::Release)"),
            edit("queue", "hints.load(Ordering::SeqCst)", "hints.load(Ordering::Relaxed)"),
            edit("hot", "hints.load(Ordering::SeqCst)", "hints.load(Ordering::Relaxed)"),
        ],
        caught_by: "a_body_is_handed_over_whole",
        says: WRONG,
    },
    // The sender's next write of the body races with the receiver's read.
    Broken {
        name: "release_without_release",
        edits: &[edit(
            "slots",
            "        self.change(taken.slot, taken.word, FREE);\n",
            "        let _ = self.word(taken.slot).compare_exchange(taken.word.0, FREE.0, Ordering::Acquire, \
             Ordering::Relaxed);\n",
        )],
        caught_by: "a_body_is_handed_over_whole",
        says: RACE,
    },
    // The same race, seen from the other side.
    Broken {
        name: "claim_without_acquire",
        edits: &[edit(
            "slots",
            "&& self.change(slot, FREE, word) {",
            "&& self.word(slot).compare_exchange(FREE.0, word.0, Ordering::Release, Ordering::Relaxed).is_ok() {",
        )],
        caught_by: "a_body_is_handed_over_whole",
        says: RACE,
    },
    // Two senders have one slot.
    Broken {
        name: "claim_without_compare",
        edits: &[edit(
            "slots",
            "&& self.change(slot, FREE, word) {",
            "&& { self.word(slot).swap(word.0, Ordering::AcqRel); true } {",
        )],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // ---- hints ----
    // The receiver swaps the hint, finds the slot still Filling, and never looks again.
    Broken {
        name: "hint_before_word",
        edits: &[
            edit("slots", "        self.hint(slot);\n        step!(\"publish: hint\");\n", ""),
            edit(
                "slots",
                "        let word = Word::ready(priority, if claim.place == FREE { ticket } else { \
                 claim.place.ticket() });\n",
                "        let word = Word::ready(priority, if claim.place == FREE { ticket } else { \
                 claim.place.ticket() });\n        \
                 self.hint(slot);\n",
            ),
        ],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // The same, by reordering: the hint is seen before the word it speaks of.
    Broken {
        name: "hint_without_release",
        edits: &[edit(
            "hot",
            "fetch_or(1 << (slot % 64), Ordering::SeqCst)",
            "fetch_or(1 << (slot % 64), Ordering::Relaxed)",
        )],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // And from the receiver's side.
    Broken {
        name: "hint_without_acquire",
        edits: &[edit("queue", "hints.swap(0, Ordering::AcqRel)", "hints.swap(0, Ordering::Release)")],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // A hint set between the look at its word and the swap is wiped out.
    Broken {
        name: "hints_cleared_after_the_look",
        edits: &[
            edit("queue", "hints.swap(0, Ordering::AcqRel)", "hints.load(Ordering::Acquire)"),
            edit(
                "queue",
                "if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }\n            }\n",
                "if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }\n            \
                 }\n            if fresh != 0 { hints.swap(0, Ordering::AcqRel); }\n",
            ),
        ],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // ---- order ----
    // The receiver looks at slot 0, which is free; then both packages are published; then it sees the second in slot 1.
    Broken {
        name: "no_horizon",
        edits: &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit("queue", "if word.ticket() < horizon {", "if word.ticket() < u64::MAX {"),
        ],
        caught_by: "a_second_package_never_passes_the_first",
        says: WRONG,
    },
    // The counter is read, but not what was published before: slot 0 looks free still.
    Broken {
        name: "horizon_without_acquire",
        edits: &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit("queue", "ticket.0.load(Ordering::Acquire)", "ticket.0.load(Ordering::Relaxed)"),
        ],
        caught_by: "a_second_package_never_passes_the_first",
        says: WRONG,
    },
    // The same from the other side. Only without fence (E): it stands between a sender's hint and its next ticket.
    Broken {
        name: "ticket_without_release",
        edits: &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit("slots", "ticket.0.fetch_add(1, Ordering::AcqRel)", "ticket.0.fetch_add(1, Ordering::Acquire)"),
            edit("slots", FENCE_E, NO_FENCE_E),
        ],
        caught_by: "a_second_package_never_passes_the_first",
        says: WRONG,
    },
    // A deferred slot must be looked at again though its hint is gone.
    Broken {
        name: "too_young_is_forgotten",
        edits: &[ONLY_WITH_HORIZON, WITHOUT_RETURN, edit("queue", "else { self.defer(slot) }", "else { }")],
        caught_by: "everything_arrives_once_and_in_order",
        says: WRONG,
    },
    // Claimed first, published second: the order would be that of claiming, and T no longer a horizon.
    Broken {
        name: "ticket_at_claim",
        edits: &[
            edit(
                "slots",
                "    segment: u64,\n    word: Word,\n    /// The package that",
                "    segment: u64,\n    word: Word,\n    ticket: u64,\n    /// The package that",
            ),
            edit(
                "slots",
                "return Ok(Claim { slot, segment: self.bodies.segment, word, place: FREE, late: false });",
                "return Ok(Claim { slot, segment: self.bodies.segment, word, place: FREE, late: false, ticket: \
                 self.hot.ticket.0.fetch_add(1, Ordering::AcqRel) });",
            ),
            edit(
                "slots",
                "return Some(Claim { slot, segment: self.bodies.segment, word, place: FREE, late });",
                "return Some(Claim { slot, segment: self.bodies.segment, word, place: FREE, late, ticket: \
                 self.hot.ticket.0.fetch_add(1, Ordering::AcqRel) });",
            ),
            edit(
                "slots",
                "slot: old.slot, segment, word, place: old.word, late: false })",
                "slot: old.slot, segment, word, place: old.word, late: false, ticket: 0 })",
            ),
            edit(
                "slots",
                "let ticket = self.hot.ticket.0.fetch_add(1, Ordering::AcqRel);",
                "let ticket = claim.ticket;",
            ),
        ],
        caught_by: "publishing_gives_the_order",
        says: WRONG,
    },
    // The first look meets the second package of a sender; the first came behind it, and no other look follows.
    Broken {
        name: "no_look_for_more",
        edits: &[edit("queue", "if !slots.any_hint() {", "if true {")],
        caught_by: "a_second_package_never_passes_the_first",
        says: WRONG,
    },
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
    // ---- displacing ----
    // The receiver has taken the package meanwhile: it is received and counted as lost.
    Broken {
        name: "displace_without_compare",
        edits: &[edit(
            "slots",
            "if self.change(slot, last, word) {",
            "if { self.word(slot).swap(word.0, Ordering::AcqRel); true } {",
        )],
        caught_by: "a_displaced_package_is_counted_and_not_received",
        says: WRONG,
    },
    // The receiver's entry is stale: it takes whatever lies in the slot, here a package still being written.
    Broken {
        name: "take_without_compare",
        edits: &[edit(
            "slots",
            "self.change(slot, seen, word).then_some",
            "{ self.word(slot).swap(word.0, Ordering::AcqRel); true }.then_some",
        )],
        caught_by: "a_displaced_package_is_counted_and_not_received",
        says: RACE,
    },
    // The receiver takes the last package that could be displaced, and the mailbox is empty: still it is called full.
    Broken {
        name: "displace_overlooks_freed_slots",
        edits: &[edit("slots", "*word == FREE || word.is_ready()", "word.is_ready()")],
        caught_by: "a_sender_that_outranks_all_is_not_refused",
        says: WRONG,
    },
    // The loss shows nowhere.
    Broken {
        name: "displaced_not_counted",
        edits: &[edit(
            "slots",
            "(last != FREE).then(|| Victim { priority: last.priority(), replaced: false })",
            "None",
        )],
        caught_by: "two_displace_two",
        says: WRONG,
    },
    // ---- only the newest ----
    // The receiver has it in hand: it is received and counted as replaced, and its slot is freed under it.
    Broken {
        name: "replace_without_compare",
        edits: &[edit(
            "slots",
            "if self.change(old.slot, old.word, FREE) {",
            "if { self.word(old.slot).swap(FREE.0, Ordering::AcqRel); true } {",
        )],
        caught_by: "the_newest_replaces_what_waits",
        says: WRONG,
    },
    // The same in a full mailbox.
    Broken {
        name: "reuse_without_compare",
        edits: &[edit(
            "slots",
            "let reused = self.change(old.slot, old.word, word);",
            "let reused = { self.word(old.slot).swap(word.0, Ordering::AcqRel); true };",
        )],
        caught_by: "the_newest_reuses_the_only_slot",
        says: WRONG,
    },
    // Received, and counted as replaced.
    Broken {
        name: "counted_though_it_was_received",
        edits: &[edit(
            "slots",
            "self.change(claim.slot, marked, claim.word);",
            "if true { claim.word = marked; return true; }",
        )],
        caught_by: "the_newest_replaces_what_waits",
        says: WRONG,
    },
    // The older one waits still, and is received after the newer or before it, but beside it.
    Broken {
        name: "nothing_is_replaced",
        edits: &[edit(
            "slots",
            "        let State::Filling { by, .. } = claim.word.state() else { return false };",
            "        let State::Filling { by, .. } = claim.word.state() else { return false };\n        if true { \
             return false; }",
        )],
        caught_by: "the_newest_keeps_its_place",
        says: WRONG,
    },
    // In a hurry: published beside the older one, in the same place of the order, and which of them goes first is
    // chance.
    Broken {
        name: "replaced_after_publishing",
        edits: &[
            edit(
                "rig",
                "if self.last.is_some_and(|old| slots.replace(&mut claim, old)) {",
                "let late = self.last;\n        if false {",
            ),
            edit("slots", "{ ticket } else { claim.place.ticket() }", "{ 0 } else { claim.place.ticket() }"),
            edit(
                "rig",
                "                self.last = (self.full == OverflowPolicy::Latest).then_some(posted);",
                "                if let Some(old) = late {\n                    if slots.take(old.slot, \
                 old.word).map(|old| slots.release(old)).is_some() {\n                        \
                 self.mailbox.count(Victim { priority: Priority(priority), replaced: true });\n                    \
                 }\n                }\n                self.last = (self.full == \
                 OverflowPolicy::Latest).then_some(posted);",
            ),
        ],
        caught_by: "the_newest_replaces_what_waits",
        says: "it goes back",
    },
    // Always last in the queue: with others that send as fast as the receiver receives, it is never received.
    Broken {
        name: "the_newest_goes_to_the_end",
        edits: &[edit("slots", "if claim.place == FREE { ticket } else { claim.place.ticket() }", "ticket")],
        caught_by: "the_newest_keeps_its_place",
        says: WRONG,
    },
    // The older one is gone, and a sender that dies now has told nobody.
    Broken {
        name: "replaces_unmarked",
        edits: &[edit(
            "slots",
            "let marked = Word::filling(by, Some(old.as_victim()));",
            "let marked = Word::filling(by, None);",
        )],
        caught_by: "a_replacer_dies_when_the_old_one_is_gone",
        says: "hidden",
    },
    Broken {
        name: "reuses_unmarked",
        edits: &[edit(
            "slots",
            "let word = Word::filling(by, Some(old.as_victim()));",
            "let word = Word::filling(by, None);",
        )],
        caught_by: "a_replacer_dies_in_the_only_slot",
        says: "hidden",
    },
    // The counters went on elsewhere between replacing and counting.
    Broken {
        name: "settles_no_replaced",
        edits: &[edit(
            "slots",
            "lost(victim);\n                step!(\"settle: counted\");",
            "if !victim.replaced { lost(victim); }\n                step!(\"settle: counted\");",
        )],
        caught_by: "a_retired_mailbox_counts_the_replaced",
        says: "hidden",
    },
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
    // ---- giving up ----
    // Neither sees the other: an accepted package stays in a mailbox that nobody receives from.
    Broken {
        name: "no_fence_e_at_retirement",
        edits: &[edit("slots", FENCE_E, NO_FENCE_E)],
        caught_by: "a_retired_mailbox_keeps_nothing",
        says: WRONG,
    },
    Broken {
        name: "no_fence_g",
        edits: &[edit(
            "hot",
            "last look at the words. Pairs with (E).\n        fence(Ordering::SeqCst);\n",
            "last look at the words. Pairs with (E).\n",
        )],
        caught_by: "a_retired_mailbox_keeps_nothing",
        says: WRONG,
    },
    // What a sender displaced, and has not counted yet when the counters are carried over.
    Broken {
        name: "settles_nothing",
        edits: &[edit(
            "slots",
            "lost(victim);\n                step!(\"settle: counted\");",
            "step!(\"settle: counted\");",
        )],
        caught_by: "a_replaced_mailbox_hides_no_loss",
        says: "hidden",
    },
    // Displaced after the owner's last look, and counted where nobody looks any more.
    Broken {
        name: "forgets_late_victims",
        edits: &[edit("slots", "self.victim().filter(|_| self.late)", "None")],
        caught_by: "a_replaced_mailbox_hides_no_late_loss",
        says: "hidden",
    },
    // Retired between claim and publishing.
    Broken {
        name: "retirement_seen_only_at_claim",
        edits: &[edit(
            "slots",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && self.change(slot, word, claim.word) {",
            "if false {",
        )],
        caught_by: "a_retired_mailbox_keeps_nothing",
        says: WRONG,
    },
    // Found by the owner and sent anew elsewhere: twice.
    Broken {
        name: "taken_back_without_compare",
        edits: &[edit(
            "slots",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && self.change(slot, word, claim.word) {",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && { self.word(slot).swap(claim.word.0, \
             Ordering::AcqRel); true } {",
        )],
        caught_by: "a_retired_mailbox_keeps_nothing",
        says: WRONG,
    },
    // ---- deaths ----
    // The slot is given to another while its filler still writes.
    Broken {
        name: "reclaims_the_living",
        edits: &[edit("slots", "if dead(by) {", "if dead(by) || true {")],
        caught_by: "a_sender_dies_with_a_claim",
        says: WRONG,
    },
    // A slot less with every death.
    Broken {
        name: "reclaims_nothing",
        edits: &[edit("slots", "freed += usize::from(self.change(slot, word, FREE));", "freed += 0;")],
        caught_by: "a_sender_dies_with_a_ticket",
        says: WRONG,
    },
    // An accepted package is gone, and no counter knows.
    Broken {
        name: "reclaim_forgets_the_displaced",
        edits: &[edit("slots", "victim.into_iter().for_each(&mut lost);", "let _ = (victim, &mut lost);")],
        caught_by: "a_displacer_dies",
        says: WRONG,
    },
    // A sender that died between word and hint has told nobody.
    Broken {
        name: "rescan_looks_nowhere",
        edits: &[edit("queue", "(0..slots.count()).for_each(|slot| self.defer(slot));", "let _ = slots;")],
        caught_by: "a_sender_dies_without_its_hint",
        says: WRONG,
    },
    // The same, when no death was noticed.
    Broken {
        name: "no_look_in_turn",
        edits: &[edit("queue", "if self.receives.is_multiple_of(RESCAN_EVERY) {", "if false {")],
        caught_by: "a_package_without_hint_is_found_in_turn",
        says: WRONG,
    },
    // The package that a dead receiver had in hand stays there for ever.
    Broken {
        name: "adoption_leaves_taken",
        edits: &[edit(
            "slots",
            "            if word.state() != State::Taken {\n                continue;",
            "            if true {\n                continue;",
        )],
        caught_by: "a_package_in_dead_hands_is_delivered_once_more",
        says: WRONG,
    },
    // A package that kills its receiver kills each of its successors.
    Broken {
        name: "redelivery_unmarked",
        edits: &[edit("word", "READY << STATE | REDELIVERED)", "READY << STATE)")],
        caught_by: "a_package_in_dead_hands_is_delivered_once_more",
        says: WRONG,
    },
];

/// Lines of the mailbox that the models write again, in the order in which they must stand there.
pub(crate) struct Mirrored {
    pub(crate) file: &'static str,
    pub(crate) what: &'static str,
    pub(crate) lines: &'static [&'static str],
}

pub(crate) const MIRRORED: &[Mirrored] = &[
    Mirrored {
        file: "waiting",
        what: "models::Receiver::wait does the same, change both",
        lines: &[
            "fn settled(",
            "let seen = entry.bell().seen();",
            ".drowsy());",
            "let idle = !found()",
            "watches.sleep(entry.bell(), seen,",
            "doorbell::sleep(&entry.bell, seen,",
            ".awake());",
        ],
    },
    Mirrored {
        file: "watch",
        what: "models::Receiver::wait does the same, change both",
        // The real one also looks at the bell by itself now and then; here the pipe alone must do.
        lines: &[
            "fn sleep(",
            "let quiet = bell.may_poll(seen);",
            "let mut nap = if quiet {",
            "while self.poll(nap)",
            "bell.polled();",
        ],
    },
    Mirrored {
        file: "receiver",
        what: "models::a_retired_mailbox_keeps_nothing does the same, change both",
        lines: &[
            "pub fn close(",
            "slots.retire();",
            "self.queue.rescan(&slots);",
            "self.queue.take(&slots)",
            "slots.release(taken);",
        ],
    },
    Mirrored {
        file: "receiver",
        what: "models::Receiver::search does the same, change both",
        lines: &["fn search(", "slots.reclaim(", "self.queue.rescan(&slots);", "self.queue.doubt();"],
    },
    Mirrored {
        file: "registry",
        what: "models::a_retired_mailbox_keeps_nothing does the same, change both",
        lines: &[
            "fn retire(",
            "slots.retire();",
            "slots.adopt(",
            "queue.rescan(&slots);",
            "queue.take(&slots)",
            "slots.release(taken);",
        ],
    },
    Mirrored {
        file: "sender",
        what: "models::Sender::send does the same, change both",
        lines: &[
            "fn publish(",
            "self.count_victim(&claim);",
            "self.posts.of(label).is_some_and(|old| slots.replace(&mut claim, old))",
            "self.count_victim(&claim);",
            ".publish(claim, label.priority)",
            "self.posts.remember(label, posted, &slots);",
            "if wake {",
            "self.wake();",
        ],
    },
    Mirrored {
        file: "slots",
        what: "SeqCst stands for the fence that the models have there (seq_cst_accesses), and no model would see it \
            weakened",
        lines: &[
            "compare_exchange(from.0, to.0, Ordering::SeqCst, Ordering::Relaxed)",
            "self.hot.receiver.0.retired.load(Ordering::SeqCst)",
            "seq_cst_accesses();",
            "receiver.retired.load(Ordering::SeqCst)",
            "receiver.level.load(Ordering::SeqCst)",
            "receiver.sleeping.load(Ordering::SeqCst)",
        ],
    },
    Mirrored {
        file: "hot",
        what: "SeqCst stands for the fence that the models have there (seq_cst_accesses), and no model would see it \
            weakened",
        lines: &[
            "fetch_or(1 << (slot % 64), Ordering::SeqCst)",
            "sleeping.store(sleeping, Ordering::SeqCst)",
            "hints.load(Ordering::SeqCst)",
            "level.store(level.0.into(), Ordering::SeqCst)",
        ],
    },
    Mirrored {
        file: "queue",
        what: "SeqCst stands for the fence that the models have before it (seq_cst_accesses), and no model would see \
            it weakened",
        lines: &["hints.load(Ordering::SeqCst)"],
    },
    Mirrored {
        file: "doorbell",
        what: "models::Mailbox::ring does the same, change both",
        lines: &["fn ring(", "let polling = bell.ring();", "FUTEX_WAKE", "if polling {", "write_to_pipe("],
    },
];
