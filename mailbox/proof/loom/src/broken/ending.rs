//! Mistakes in giving a mailbox up, and about deaths.

use super::variant::{Broken, FENCE_E, NO_FENCE_E, WRONG, edit};

pub(crate) const BROKEN: &[Broken] = &[
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
    // A sender that goes elsewhere with its package has displaced one all the same.
    Broken {
        name: "counts_the_displaced_when_accepted",
        edits: &[
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
        caught_by: "a_retired_mailbox_counts_the_displaced",
        says: WRONG,
    },
    // Whatever is neither free nor a package was in dead hands, it seems; a sender is filling it.
    Broken {
        name: "adopts_what_is_being_filled",
        edits: &[edit("slots", "if word.state() != State::Taken {", "if word == FREE || word.is_ready() {")],
        caught_by: "a_retired_mailbox_keeps_nothing_of_the_dead",
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
    // What replaces has its package elsewhere, but its claim is in this slot.
    Broken {
        name: "reclaim_leaves_what_replaces",
        edits: &[edit("slots", "if dead(by) {", "if dead(by) && !victim.is_some_and(|victim| victim.replaced) {")],
        caught_by: "a_replacer_dies_before_the_old_one_goes",
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
