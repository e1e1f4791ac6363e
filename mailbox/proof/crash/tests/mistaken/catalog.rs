//! The mistakes, each with the scene that notices it. `broken!` asks whether its mistake is made.

use rohrpost_planted::{Mistake, edit, instead, left_out};

const SENDING: &str = "sending::a_sender_dies_sending";

pub(crate) const MISTAKES: &[Mistake] = &[
    // ---- what the dead left in slots ----
    Mistake {
        name: "what_the_dead_filled_is_published",
        edits: &[edit(
            "slots/protocol.rs",
            "freed += usize::from(self.change(slot, word, FREE));",
            "let left = if broken!(what_the_dead_filled_is_published) { Word::ready(Priority(0), 0) } else { FREE };
                freed += usize::from(self.change(slot, word, left));",
        )],
        test: SENDING,
        says: "check Whole",
    },
    // The slot is lost for ever.
    Mistake {
        name: "claims_of_the_dead_stay",
        edits: &[edit("slots/protocol.rs", "if dead(by) {", "if !broken!(claims_of_the_dead_stay) && dead(by) {")],
        test: SENDING,
        says: "check Usable",
    },
    Mistake {
        name: "the_dead_forget_what_they_displaced",
        edits: &[edit(
            "slots/protocol.rs",
            "victim.into_iter().for_each(&mut lost);",
            "victim.filter(|_| !broken!(the_dead_forget_what_they_displaced)).into_iter().for_each(&mut lost);",
        )],
        test: "sending::a_sender_dies_displacing",
        says: "no loss is hidden",
    },
    // Sent, and its sender died before it could hint.
    Mistake {
        name: "a_search_looks_at_hints_alone",
        edits: &[left_out("slots/queue.rs", "(0..slots.count()).for_each(|slot| self.defer(slot));")],
        test: SENDING,
        says: "check Drained",
    },
    Mistake {
        name: "what_was_in_dead_hands_stays_there",
        edits: &[edit(
            "slots/protocol.rs",
            "if word.state() != State::Taken {",
            "if broken!(what_was_in_dead_hands_stays_there) || word.state() != State::Taken {",
        )],
        test: "receiving::a_receiver_dies_receiving",
        says: "check Drained",
    },
    // It kills its next receiver, and the one after that.
    Mistake {
        name: "what_was_in_dead_hands_is_not_marked",
        edits: &[edit(
            "slots/protocol.rs",
            "self.change(slot, word, word.redelivered());",
            "let again = if broken!(what_was_in_dead_hands_is_not_marked) {
                    Word::ready(word.priority(), word.ticket())
                } else {
                    word.redelivered()
                };
                self.change(slot, word, again);",
        )],
        test: "receiving::a_receiver_dies_receiving",
        says: "assertion `left == right` failed",
    },
    Mistake {
        name: "poison_is_dropped_uncounted",
        edits: &[left_out("slots/protocol.rs", "poison(word.priority());")],
        test: "receiving::a_receiver_dies_adopting_what_killed_the_last_two",
        says: "0 counted as poison",
    },
    Mistake {
        name: "a_death_rings_nobody",
        edits: &[left_out("node/directory.rs", "doorbell::ring_all(self);")],
        test: "sending::a_sender_dies_beside_a_sleeping_receiver",
        says: "left: None",
    },
    // ---- accounts ----
    Mistake {
        name: "the_stale_are_dropped_uncounted",
        edits: &[edit(
            "receiver.rs",
            "self.segment.page().counters.lost(taken.word().priority(), Loss::Stale, 1);",
            "let counted = u64::from(!broken!(the_stale_are_dropped_uncounted));
            self.segment.page().counters.lost(taken.word().priority(), Loss::Stale, counted);",
        )],
        test: "receiving::a_receiver_dies_dropping_stale_packages",
        says: "check Accounts",
    },
    Mistake {
        name: "what_is_given_up_is_uncounted",
        edits: &[edit(
            "node/registry.rs",
            "old.page().counters.lost(taken.word().priority(), Loss::Closed, 1);",
            "let counted = u64::from(!broken!(what_is_given_up_is_uncounted));
        old.page().counters.lost(taken.word().priority(), Loss::Closed, counted);",
        )],
        test: "receiving::a_receiver_dies_replacing_a_mailbox_of_another_shape",
        says: "0 counted as lost",
    },
    // ---- the mailbox goes on ----
    Mistake {
        name: "equals_are_displaced",
        edits: &[edit(
            "slots/protocol.rs",
            "priority.outranks(word.priority())",
            "(priority.outranks(word.priority()) || broken!(equals_are_displaced) && priority == word.priority())",
        )],
        test: SENDING,
        says: "check Full",
    },
    Mistake {
        name: "the_last_slot_is_overlooked",
        edits: &[edit(
            "slots/queue.rs",
            "if slot >= slots.count() {",
            "if slot >= slots.count() - usize::from(broken!(the_last_slot_is_overlooked)) {",
        )],
        test: SENDING,
        says: "check Received",
    },
    Mistake {
        name: "the_last_goes_first",
        edits: &[edit(
            "slots/protocol.rs",
            "if claim.place == FREE { ticket }",
            "if broken!(the_last_goes_first) { !ticket } else if claim.place == FREE { ticket }",
        )],
        test: SENDING,
        says: "check InOrder",
    },
    Mistake {
        name: "nothing_is_released",
        edits: &[left_out("slots/protocol.rs", "self.change(taken.slot, taken.word, FREE);")],
        test: SENDING,
        says: "check UsableAgain",
    },
    Mistake {
        name: "closing_finds_nothing",
        edits: &[edit(
            "receiver.rs",
            "while let Some(taken) = self.queue.take(&slots) {",
            "while let Some(taken) = self.queue.take(&slots).filter(|_| !broken!(closing_finds_nothing)) {",
        )],
        test: SENDING,
        says: "check Closed",
    },
    // ---- the node ends ----
    // Locks tell the living from the dead, not what they wrote.
    Mistake {
        name: "the_table_is_believed",
        edits: &[
            edit(
                "node/directory.rs",
                "let alive = |index: &u16| lock::is_locked(",
                "let alive = |index: &u16| broken!(the_table_is_believed) || lock::is_locked(",
            ),
            left_out("node/participant.rs", "entry.pid.store(0, Ordering::Release);"),
        ],
        test: SENDING,
        says: "check Nobody",
    },
    Mistake {
        name: "places_stay_locked",
        edits: &[edit(
            "node/participant.rs",
            "        self.leave();\n",
            "        self.leave();
        if broken!(places_stay_locked) {
            return std::mem::forget(self.file.try_clone());
        }\n",
        )],
        test: SENDING,
        says: "check Removable",
    },
    Mistake {
        name: "the_directory_stays",
        edits: &[left_out("node/registry.rs", "self.directory().remove_all().map_err(failed)?;")],
        test: SENDING,
        says: "check Gone",
    },
    // ---- streams ----
    Mistake {
        name: "a_finished_record_is_forgotten",
        edits: &[instead("stream/writing.rs", "named_end(ring, counted)", "counted")],
        test: "streams::a_writer_dies_writing",
        says: "a finished record",
    },
    Mistake {
        name: "the_sequence_begins_anew",
        edits: &[edit(
            "stream/segment.rs",
            "unwrap_or_else(|| old.map_or(0, ",
            "unwrap_or_else(|| old.filter(|_| !broken!(the_sequence_begins_anew)).map_or(0, ",
        )],
        test: "streams::a_writer_dies_replacing_a_stream_of_another_shape",
        says: "the sequence goes on",
    },
    Mistake {
        name: "half_of_what_is_left_out_stays",
        edits: &[left_out("stream/writing.rs", "leave_out(ring, sequence, newest, (OmissionCause::Lost, before));")],
        test: "streams::a_writer_of_a_replica_dies_leaving_records_out",
        says: "waits for what was left out",
    },
];
