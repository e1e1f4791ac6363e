//! Mistakes in full mailboxes and in replacing older packages.

use super::variant::{Broken, Edit, RACE, WRONG, edit};

const IN_PLACE_WITHOUT_RELEASE: Edit = edit(
    "slots",
    "if !self.change(slot, claim.word, word) {",
    "let success = if claim.place != FREE { Ordering::Relaxed } else { Ordering::SeqCst };\n        if \
     self.word(slot).compare_exchange(claim.word.0, word.0, success, Ordering::Relaxed).is_err() {",
);

pub(crate) const BROKEN: &[Broken] = &[
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
    // The heap has the new package where the old one stood.
    Broken {
        name: "a_changed_slot_keeps_its_rank",
        edits: &[edit(
            "queue",
            "self.heap[at as usize].0 = word;\n                at as usize",
            "self.heap[at as usize].0 = word;\n                return",
        )],
        caught_by: "displacing_keeps_the_order",
        says: "passed",
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
    // The word is an old one, and nothing new seems to be said by it. It is taken for what it says, without its hint.
    Broken {
        name: "reused_without_release",
        edits: &[IN_PLACE_WITHOUT_RELEASE],
        caught_by: "a_displaced_package_is_not_replaced_too",
        says: RACE,
    },
    // The same beside a free slot, where the mark hands the body over as well as the word.
    Broken {
        name: "a_word_comes_back_without_release",
        edits: &[
            IN_PLACE_WITHOUT_RELEASE,
            edit(
                "slots",
                "if !self.change(claim.slot, claim.word, marked) {",
                "if self.word(claim.slot).compare_exchange(claim.word.0, marked.0, Ordering::Relaxed, \
                 Ordering::Relaxed).is_err() {",
            ),
        ],
        caught_by: "a_word_comes_back_with_the_newer_package",
        says: RACE,
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
];
