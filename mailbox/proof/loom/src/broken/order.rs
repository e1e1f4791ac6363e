//! Mistakes in handing over bodies, hints and the order of packages.

use super::variant::{Broken, Edit, FENCE_E, NO_FENCE_E, RACE, WRONG, broken, edit};

/// Every look is one with a horizon, as after a first one that senders were quicker than.
const ONLY_WITH_HORIZON: Edit = edit(
    "slots/queue",
    "        self.collect(slots, u64::MAX);\n        // ORDERING: the words",
    "        // ORDERING: the words",
);

const WITHOUT_RETURN: Edit =
    edit("slots/queue", "        if !slots.any_hint() {\n            return;\n        }\n", "");

pub(crate) const BROKEN: &[Broken] = &[
    // ---- the word hands the body over: (A) to (D) ----
    // The important sender's write of the body races with that of the unimportant one, which it displaces.
    broken(
        "publish_without_release",
        &[edit(
            "slots/protocol",
            "if !self.change(slot, claim.word, word) {",
            "if self.word(slot).compare_exchange(claim.word.0, word.0, Ordering::Acquire, Ordering::Relaxed).is_err() \
             {",
        )],
        "a_displaced_package_is_counted_and_not_received",
        RACE,
    ),
    // The receiver loses packages or reads a body while its sender writes it, whichever loom meets first. All of them
    // must go for a race on the body: the hint's Acquire or the ticket counter's, which are there for other reasons,
    // hands the body over as well as the word's.
    broken(
        "receiver_without_acquire",
        &[
            edit(
                "slots/protocol",
                "self.change(slot, seen, word).then_some",
                "self.word(slot).compare_exchange(seen.0, word.0, Ordering::Release, \
                 Ordering::Relaxed).is_ok().then_some",
            ),
            edit(
                "slots/protocol",
                "Word(self.word(slot).load(Ordering::Acquire))",
                "Word(self.word(slot).load(Ordering::Relaxed))",
            ),
            edit("slots/queue", "ticket.0.load(Ordering::Acquire)", "ticket.0.load(Ordering::Relaxed)"),
            edit("slots/queue", "hints.swap(0, Ordering::AcqRel)", "hints.swap(0, Ordering::Release)"),
            edit("slots/queue", "hints.load(Ordering::SeqCst)", "hints.load(Ordering::Relaxed)"),
            edit("slots/hot", "hints.load(Ordering::SeqCst)", "hints.load(Ordering::Relaxed)"),
        ],
        "a_body_is_handed_over_whole",
        WRONG,
    ),
    // The sender's next write of the body races with the receiver's read.
    broken(
        "release_without_release",
        &[edit(
            "slots/protocol",
            "        self.change(taken.slot, taken.word, FREE);\n",
            "        let _ = self.word(taken.slot).compare_exchange(taken.word.0, FREE.0, Ordering::Acquire, \
             Ordering::Relaxed);\n",
        )],
        "a_body_is_handed_over_whole",
        RACE,
    ),
    // The same race, seen from the other side.
    broken(
        "claim_without_acquire",
        &[edit(
            "slots/protocol",
            "&& self.change(slot, FREE, word) {",
            "&& self.word(slot).compare_exchange(FREE.0, word.0, Ordering::Release, Ordering::Relaxed).is_ok() {",
        )],
        "a_body_is_handed_over_whole",
        RACE,
    ),
    // Two senders have one slot.
    broken(
        "claim_without_compare",
        &[edit(
            "slots/protocol",
            "&& self.change(slot, FREE, word) {",
            "&& { self.word(slot).swap(word.0, Ordering::AcqRel); true } {",
        )],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // ---- hints ----
    // The receiver swaps the hint, finds the slot still Filling, and never looks again.
    broken(
        "hint_before_word",
        &[
            edit("slots/protocol", "        self.hint(slot);\n        step!(\"publish: hint\");\n", ""),
            edit(
                "slots/protocol",
                "        let word = Word::ready(priority, if claim.place == FREE { ticket } else { \
                 claim.place.ticket() });\n",
                "        let word = Word::ready(priority, if claim.place == FREE { ticket } else { \
                 claim.place.ticket() });\n        \
                 self.hint(slot);\n",
            ),
        ],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // The same, by reordering: the hint is seen before the word it speaks of.
    broken(
        "hint_without_release",
        &[edit(
            "slots/hot",
            "fetch_or(1 << (slot % 64), Ordering::SeqCst)",
            "fetch_or(1 << (slot % 64), Ordering::Relaxed)",
        )],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // And from the receiver's side.
    broken(
        "hint_without_acquire",
        &[edit("slots/queue", "hints.swap(0, Ordering::AcqRel)", "hints.swap(0, Ordering::Release)")],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // A hint set between the look at its word and the swap is wiped out.
    broken(
        "hints_cleared_after_the_look",
        &[
            edit("slots/queue", "hints.swap(0, Ordering::AcqRel)", "hints.load(Ordering::Acquire)"),
            edit(
                "slots/queue",
                "if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }\n            }\n",
                "if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }\n            \
                 }\n            if fresh != 0 { hints.swap(0, Ordering::AcqRel); }\n",
            ),
        ],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // ---- order ----
    // The receiver looks at slot 0, which is free; then both packages are published; then it sees the second in slot 1.
    broken(
        "no_horizon",
        &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit("slots/queue", "if word.ticket() < horizon {", "if word.ticket() < u64::MAX {"),
        ],
        "a_second_package_never_passes_the_first",
        WRONG,
    ),
    // The counter is read, but not what was published before: slot 0 looks free still.
    broken(
        "horizon_without_acquire",
        &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit("slots/queue", "ticket.0.load(Ordering::Acquire)", "ticket.0.load(Ordering::Relaxed)"),
        ],
        "a_second_package_never_passes_the_first",
        WRONG,
    ),
    // The same from the other side. Only without fence (E): it stands between a sender's hint and its next ticket.
    broken(
        "ticket_without_release",
        &[
            ONLY_WITH_HORIZON,
            WITHOUT_RETURN,
            edit(
                "slots/protocol",
                "ticket.0.fetch_add(1, Ordering::AcqRel)",
                "ticket.0.fetch_add(1, Ordering::Acquire)",
            ),
            edit("slots/protocol", FENCE_E, NO_FENCE_E),
        ],
        "a_second_package_never_passes_the_first",
        WRONG,
    ),
    // A deferred slot must be looked at again though its hint is gone.
    broken(
        "too_young_is_forgotten",
        &[ONLY_WITH_HORIZON, WITHOUT_RETURN, edit("slots/queue", "else { self.defer(slot) }", "else { }")],
        "everything_arrives_once_and_in_order",
        WRONG,
    ),
    // Claimed first, published second: the order would be that of claiming, and T no longer a horizon.
    broken(
        "ticket_at_claim",
        &[
            edit(
                "slots/protocol",
                "    segment: u64,\n    word: Word,\n    /// The package that",
                "    segment: u64,\n    word: Word,\n    ticket: u64,\n    /// The package that",
            ),
            edit(
                "slots/protocol",
                "return Ok(Claim { slot, segment: self.bodies.segment, word, place: FREE, late: false });",
                "return Ok(Claim { slot, segment: self.bodies.segment, word, place: FREE, late: false, ticket: \
                 self.hot.ticket.0.fetch_add(1, Ordering::AcqRel) });",
            ),
            edit(
                "slots/protocol",
                "return Some(Claim { slot, segment: self.bodies.segment, word, place: FREE, late });",
                "return Some(Claim { slot, segment: self.bodies.segment, word, place: FREE, late, ticket: \
                 self.hot.ticket.0.fetch_add(1, Ordering::AcqRel) });",
            ),
            edit(
                "slots/protocol",
                "slot: old.slot, segment, word, place: old.word, late: false })",
                "slot: old.slot, segment, word, place: old.word, late: false, ticket: 0 })",
            ),
            edit(
                "slots/protocol",
                "let ticket = self.hot.ticket.0.fetch_add(1, Ordering::AcqRel);",
                "let ticket = claim.ticket;",
            ),
        ],
        "publishing_gives_the_order",
        WRONG,
    ),
    // The first look meets the second package of a sender; the first came behind it, and no other look follows.
    broken(
        "no_look_for_more",
        &[edit("slots/queue", "if !slots.any_hint() {", "if true {")],
        "a_second_package_never_passes_the_first",
        WRONG,
    ),
];
