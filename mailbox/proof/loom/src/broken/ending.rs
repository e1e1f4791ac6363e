//! Mistakes in giving a mailbox up, and about deaths.

use super::variant::{Broken, FENCE_E, NO_FENCE_E, WRONG, broken, edit};

pub(crate) const BROKEN: &[Broken] = &[
    // ---- giving up ----
    // Neither sees the other: an accepted package stays in a mailbox that nobody receives from.
    broken(
        "no_fence_e_at_retirement",
        &[edit("slots/protocol", FENCE_E, NO_FENCE_E)],
        "a_retired_mailbox_keeps_nothing",
        WRONG,
    ),
    broken(
        "no_fence_g",
        &[edit(
            "slots/hot",
            "last look at the words. Pairs with (E).\n        fence(Ordering::SeqCst);\n",
            "last look at the words. Pairs with (E).\n",
        )],
        "a_retired_mailbox_keeps_nothing",
        WRONG,
    ),
    // A sender that goes elsewhere with its package has displaced one all the same.
    broken(
        "counts_the_displaced_when_accepted",
        &[
            edit(
                "rig",
                "unsafe { *cell = body });\n        claim.victim().into_iter().for_each(|victim| \
                 self.mailbox.count(victim));\n",
                "unsafe { *cell = body });\n        let displaced = claim.victim();\n",
            ),
            edit(
                "rig",
                "Published::Accepted { posted, wake } => {\n",
                "Published::Accepted { posted, wake } => {\n                displaced.into_iter().for_each(|victim| \
                 self.mailbox.count(victim));\n",
            ),
        ],
        "a_retired_mailbox_counts_the_displaced",
        WRONG,
    ),
    // Whatever is neither free nor a package was in dead hands, it seems; a sender is filling it.
    broken(
        "adopts_what_is_being_filled",
        &[edit("slots/protocol", "if word.state() != State::Taken {", "if word == FREE || word.is_ready() {")],
        "a_retired_mailbox_keeps_nothing_of_the_dead",
        WRONG,
    ),
    // What a sender displaced, and has not counted yet when the counters are carried over.
    broken(
        "settles_nothing",
        &[edit(
            "slots/protocol",
            "lost(victim);\n                step!(\"settle: counted\");",
            "step!(\"settle: counted\");",
        )],
        "a_replaced_mailbox_hides_no_loss",
        "hidden",
    ),
    // Displaced after the owner's last look, and counted where nobody looks any more.
    broken(
        "forgets_late_victims",
        &[edit("slots/protocol", "self.victim().filter(|_| self.late)", "None")],
        "a_replaced_mailbox_hides_no_late_loss",
        "hidden",
    ),
    // Retired between claim and publishing.
    broken(
        "retirement_seen_only_at_claim",
        &[edit(
            "slots/protocol",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && self.change(slot, word, claim.word) {",
            "if false {",
        )],
        "a_retired_mailbox_keeps_nothing",
        WRONG,
    ),
    // Found by the owner and sent anew elsewhere: twice.
    broken(
        "taken_back_without_compare",
        &[edit(
            "slots/protocol",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && self.change(slot, word, claim.word) {",
            "if receiver.retired.load(Ordering::SeqCst) != 0 && { self.word(slot).swap(claim.word.0, \
             Ordering::AcqRel); true } {",
        )],
        "a_retired_mailbox_keeps_nothing",
        WRONG,
    ),
    // ---- deaths ----
    // The slot is given to another while its filler still writes.
    broken(
        "reclaims_the_living",
        &[edit("slots/protocol", "if dead(by) {", "if dead(by) || true {")],
        "a_sender_dies_with_a_claim",
        WRONG,
    ),
    // A slot less with every death.
    broken(
        "reclaims_nothing",
        &[edit("slots/protocol", "freed += usize::from(self.change(slot, word, FREE));", "freed += 0;")],
        "a_sender_dies_with_a_ticket",
        WRONG,
    ),
    // What replaces has its package elsewhere, but its claim is in this slot.
    broken(
        "reclaim_leaves_what_replaces",
        &[edit("slots/protocol", "if dead(by) {", "if dead(by) && !victim.is_some_and(|victim| victim.replaced) {")],
        "a_replacer_dies_before_the_old_one_goes",
        WRONG,
    ),
    // An accepted package is gone, and no counter knows.
    broken(
        "reclaim_forgets_the_displaced",
        &[edit("slots/protocol", "victim.into_iter().for_each(&mut lost);", "let _ = (victim, &mut lost);")],
        "a_displacer_dies",
        WRONG,
    ),
    // A sender that died between word and hint has told nobody.
    broken(
        "rescan_looks_nowhere",
        &[edit("slots/queue", "(0..slots.count()).for_each(|slot| self.defer(slot));", "let _ = slots;")],
        "a_sender_dies_without_its_hint",
        WRONG,
    ),
    // The same, when no death was noticed.
    broken(
        "no_look_in_turn",
        &[edit("slots/queue", "if self.receives.is_multiple_of(RESCAN_EVERY) {", "if false {")],
        "a_package_without_hint_is_found_in_turn",
        WRONG,
    ),
    // The package that a dead receiver had in hand stays there for ever.
    broken(
        "adoption_leaves_taken",
        &[edit(
            "slots/protocol",
            "            if word.state() != State::Taken {\n                continue;",
            "            if true {\n                continue;",
        )],
        "a_package_in_dead_hands_is_delivered_once_more",
        WRONG,
    ),
    // A package that kills its receiver kills each of its successors.
    broken(
        "redelivery_unmarked",
        &[edit("slots/word", "READY << STATE | REDELIVERED)", "READY << STATE)")],
        "a_package_in_dead_hands_is_delivered_once_more",
        WRONG,
    ),
];
