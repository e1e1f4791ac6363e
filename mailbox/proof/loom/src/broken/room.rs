//! Mistakes in full mailboxes and in replacing older packages.

use super::variant::{Broken, Edit, RACE, WRONG, broken, edit};

const IN_PLACE_WITHOUT_RELEASE: Edit = edit(
    "slots/protocol",
    "if !self.change(slot, claim.word, word) {",
    "let success = if claim.place != FREE { Ordering::Relaxed } else { Ordering::SeqCst };\n        if \
     self.word(slot).compare_exchange(claim.word.0, word.0, success, Ordering::Relaxed).is_err() {",
);

pub(crate) const BROKEN: &[Broken] = &[
    // ---- displacing ----
    // The receiver has taken the package meanwhile: it is received and counted as lost.
    broken(
        "displace_without_compare",
        &[edit(
            "slots/protocol",
            "if self.change(slot, last, word) {",
            "if { self.word(slot).swap(word.0, Ordering::AcqRel); true } {",
        )],
        "a_displaced_package_is_counted_and_not_received",
        WRONG,
    ),
    // The receiver's entry is stale: it takes whatever lies in the slot, here a package still being written.
    broken(
        "take_without_compare",
        &[edit(
            "slots/protocol",
            "self.change(slot, seen, word).then_some",
            "{ self.word(slot).swap(word.0, Ordering::AcqRel); true }.then_some",
        )],
        "a_displaced_package_is_counted_and_not_received",
        RACE,
    ),
    // The heap has the new package where the old one stood.
    broken(
        "a_changed_slot_keeps_its_rank",
        &[edit(
            "slots/queue",
            "self.heap[at as usize].0 = word;\n                at as usize",
            "self.heap[at as usize].0 = word;\n                return",
        )],
        "displacing_keeps_the_order",
        "passed",
    ),
    // The receiver takes the last package that could be displaced, and the mailbox is empty: still it is called full.
    broken(
        "displace_overlooks_freed_slots",
        &[edit("slots/protocol", "*word == FREE || word.is_ready()", "word.is_ready()")],
        "a_sender_that_outranks_all_is_not_refused",
        WRONG,
    ),
    // The loss shows nowhere.
    broken(
        "displaced_not_counted",
        &[edit(
            "slots/protocol",
            "(last != FREE).then(|| Victim { priority: last.priority(), replaced: false })",
            "None",
        )],
        "two_displace_two",
        WRONG,
    ),
    // ---- only the newest ----
    // The receiver has it in hand: it is received and counted as replaced, and its slot is freed under it.
    broken(
        "replace_without_compare",
        &[edit(
            "slots/protocol",
            "if self.change(old.slot, old.word, FREE) {",
            "if { self.word(old.slot).swap(FREE.0, Ordering::AcqRel); true } {",
        )],
        "the_newest_replaces_what_waits",
        WRONG,
    ),
    // The same in a full mailbox.
    broken(
        "reuse_without_compare",
        &[edit(
            "slots/protocol",
            "let reused = self.change(old.slot, old.word, word);",
            "let reused = { self.word(old.slot).swap(word.0, Ordering::AcqRel); true };",
        )],
        "the_newest_reuses_the_only_slot",
        WRONG,
    ),
    // Received, and counted as replaced.
    broken(
        "counted_though_it_was_received",
        &[edit(
            "slots/protocol",
            "self.change(claim.slot, marked, claim.word);",
            "if true { claim.word = marked; return true; }",
        )],
        "the_newest_replaces_what_waits",
        WRONG,
    ),
    // The older one waits still, and is received after the newer or before it, but beside it.
    broken(
        "nothing_is_replaced",
        &[edit(
            "slots/protocol",
            "        let State::Filling { by, .. } = claim.word.state() else { return false };",
            "        let State::Filling { by, .. } = claim.word.state() else { return false };\n        if true { \
             return false; }",
        )],
        "the_newest_keeps_its_place",
        WRONG,
    ),
    // In a hurry: published beside the older one, in the same place of the order, and which of them goes first is
    // chance.
    broken(
        "replaced_after_publishing",
        &[
            edit(
                "rig",
                "if self.last.is_some_and(|old| slots.replace(&mut claim, old)) {",
                "let late = self.last;\n        if false {",
            ),
            edit("slots/protocol", "{ ticket } else { claim.place.ticket() }", "{ 0 } else { claim.place.ticket() }"),
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
        "the_newest_replaces_what_waits",
        "it goes back",
    ),
    // Always last in the queue: with others that send as fast as the receiver receives, it is never received.
    broken(
        "the_newest_goes_to_the_end",
        &[edit("slots/protocol", "if claim.place == FREE { ticket } else { claim.place.ticket() }", "ticket")],
        "the_newest_keeps_its_place",
        WRONG,
    ),
    // The word is an old one, and nothing new seems to be said by it. It is taken for what it says, without its hint.
    broken("reused_without_release", &[IN_PLACE_WITHOUT_RELEASE], "a_displaced_package_is_not_replaced_too", RACE),
    // The same beside a free slot, where the mark hands the body over as well as the word.
    broken(
        "a_word_comes_back_without_release",
        &[
            IN_PLACE_WITHOUT_RELEASE,
            edit(
                "slots/protocol",
                "if !self.change(claim.slot, claim.word, marked) {",
                "if self.word(claim.slot).compare_exchange(claim.word.0, marked.0, Ordering::Relaxed, \
                 Ordering::Relaxed).is_err() {",
            ),
        ],
        "a_word_comes_back_with_the_newer_package",
        RACE,
    ),
    // The older one is gone, and a sender that dies now has told nobody.
    broken(
        "replaces_unmarked",
        &[edit(
            "slots/protocol",
            "let marked = Word::filling(by, Some(old.as_victim()));",
            "let marked = Word::filling(by, None);",
        )],
        "a_replacer_dies_when_the_old_one_is_gone",
        "hidden",
    ),
    broken(
        "reuses_unmarked",
        &[edit(
            "slots/protocol",
            "let word = Word::filling(by, Some(old.as_victim()));",
            "let word = Word::filling(by, None);",
        )],
        "a_replacer_dies_in_the_only_slot",
        "hidden",
    ),
    // The counters went on elsewhere between replacing and counting.
    broken(
        "settles_no_replaced",
        &[edit(
            "slots/protocol",
            "lost(victim);\n                step!(\"settle: counted\");",
            "if !victim.replaced { lost(victim); }\n                step!(\"settle: counted\");",
        )],
        "a_retired_mailbox_counts_the_replaced",
        "hidden",
    ),
];
