//! The names of the models of streams, and the variants of their core that must fail in one of them.

use super::broken::{Broken, ENDLESS, Edit, RACE, broken};
use rohrpost_planted::edit;

/// Each model and the bound on its preemptions.
pub(crate) const MODELS: &[(&str, usize)] = &[
    ("a_new_record_is_copied_whole", 3),
    ("an_overwritten_copy_is_thrown_away", 2),
    ("the_writer_goes_round_what_is_held", 3),
    ("what_was_released_was_read", 3),
    ("there_always_is_a_free_frame", 2),
    ("a_successor_writes_what_was_begun", 2),
    ("a_successor_counts_what_was_finished", 2),
    ("a_successor_goes_round_what_is_held", 3),
    ("no_half_record_is_left", 3),
    ("the_writer_goes_round_what_is_held_and_left_out", 3),
    ("what_was_left_out_is_told_by_cause", 2),
    ("a_successor_leaves_out_the_rest", 2),
    ("a_dead_holder_costs_nothing", 2),
    ("no_wake_up_is_lost", 3),
    ("a_final_answer_stays", 2),
    ("an_overwritten_look_says_so", 2),
    ("a_dead_sleeper_is_forgotten_alone", 3),
];

const TORN: &str = "torn";
const LOST: &str = "a finished record is lost, or an unfinished one is none";
const CAUSE: &str = "a cause is wrong";
const NO_FRAME: &str = "there always is a free frame";

const fn ring(from: &'static str, to: &'static str) -> Edit {
    edit("stream/ring", from, to)
}

const fn writing(from: &'static str, to: &'static str) -> Edit {
    edit("stream/writing", from, to)
}

const fn left_out(from: &'static str, to: &'static str) -> Edit {
    edit("stream/left_out", from, to)
}

const FENCE_E: &str = "comes after (C) already.\n        seq_cst_accesses();";
const NO_FENCE_E: &str = "comes after (C) already.";
const FENCE_G: &str = "        fence(Ordering::SeqCst);\n        step!(\"hold: said\");";
const LOOKED_TWICE: &str =
    "fence(Ordering::Acquire);\n        self.entries[line.at].word.load(Ordering::Relaxed) == line.word";
const BEGUN: &str = "        self.word.store(word(sequence, None), Ordering::Relaxed);\n        // ORDERING (C)";

pub(crate) const BROKEN: &[Broken] = &[
    // ---- the word hands entry and frame over: (A) to (D) ----
    broken(
        "stream_publish_without_release_a",
        &[ring("word(sequence, Some(frame)), Ordering::SeqCst", "word(sequence, Some(frame)), Ordering::Relaxed")],
        "a_new_record_is_copied_whole",
        TORN,
    ),
    broken(
        "stream_look_without_acquire_b",
        &[ring("let word = entry.word.load(Ordering::Acquire);", "let word = entry.word.load(Ordering::Relaxed);")],
        "a_new_record_is_copied_whole",
        TORN,
    ),
    broken(
        "stream_entry_without_fence_c",
        &[ring("        fence(Ordering::Release);\n        step!(\"entry: begun\");", "step!(\"entry: begun\");")],
        "an_overwritten_copy_is_thrown_away",
        TORN,
    ),
    broken(
        "stream_copy_without_fence_d",
        &[ring(LOOKED_TWICE, "self.entries[line.at].word.load(Ordering::Relaxed) == line.word")],
        "an_overwritten_copy_is_thrown_away",
        TORN,
    ),
    broken(
        "stream_copy_looks_once",
        &[ring(LOOKED_TWICE, "fence(Ordering::Acquire);\n        true")],
        "an_overwritten_copy_is_thrown_away",
        TORN,
    ),
    broken(
        "stream_entry_is_changed_in_public",
        &[ring(BEGUN, "        // ORDERING (C)")],
        "an_overwritten_copy_is_thrown_away",
        TORN,
    ),
    broken(
        "stream_word_before_the_fields",
        &[ring(
            BEGUN,
            "        self.word.store(word(sequence, Some(frame)), Ordering::Release);\n        // ORDERING (C)",
        )],
        "a_new_record_is_copied_whole",
        TORN,
    ),
    // A frame without a number is named by an entry that is being written.
    broken(
        "stream_begun_is_gone",
        &[ring("if frame == 0 => return Look::NotYet", "if frame == 0 => return Look::Gone")],
        "no_half_record_is_left",
        "assertion",
    ),
    // ---- a new word against copies, holds and sleepers: (E) to (I) ----
    broken("stream_no_fence_e_for_holds", &[writing(FENCE_E, NO_FENCE_E)], "the_writer_goes_round_what_is_held", RACE),
    broken("stream_no_fence_e_for_sleepers", &[writing(FENCE_E, NO_FENCE_E)], "no_wake_up_is_lost", ENDLESS),
    broken(
        "stream_resume_without_fence_e",
        &[writing(
            "        fence(Ordering::SeqCst);\n        Self { next, free, newest, left_out }",
            "Self { next, free, newest, left_out }",
        )],
        "a_successor_goes_round_what_is_held",
        RACE,
    ),
    broken(
        "stream_no_fence_f",
        &[ring("the\n        // record is seen.\n        fence(Ordering::SeqCst);", "the\n        // record is seen.")],
        "no_wake_up_is_lost",
        ENDLESS,
    ),
    broken("stream_no_fence_g", &[ring(FENCE_G, "step!(\"hold: said\");")], "the_writer_goes_round_what_is_held", RACE),
    broken(
        "stream_hold_looks_once",
        &[ring("let held = self.entries[line.at].word.load(Ordering::Relaxed) == line.word;", "let held = true;")],
        "the_writer_goes_round_what_is_held",
        TORN,
    ),
    broken(
        "stream_hold_says_nothing",
        &[ring("        self.seats[seat].hold.store(line.frame as u32 + 1, Ordering::Release);\n", "")],
        "the_writer_goes_round_what_is_held",
        RACE,
    ),
    // The next hold hides the release before it.
    broken(
        "stream_hold_without_release_h",
        &[ring(
            "hold.store(line.frame as u32 + 1, Ordering::Release)",
            "hold.store(line.frame as u32 + 1, Ordering::Relaxed)",
        )],
        "what_was_released_was_read",
        RACE,
    ),
    broken(
        "stream_release_without_release_h",
        &[ring("hold.store(0, Ordering::Release)", "hold.store(0, Ordering::Relaxed)")],
        "the_writer_goes_round_what_is_held",
        RACE,
    ),
    broken(
        "stream_claim_without_acquire_i",
        &[writing("seat.hold.load(Ordering::SeqCst)", "seat.hold.load(Ordering::Relaxed)")],
        "the_writer_goes_round_what_is_held",
        RACE,
    ),
    broken(
        "stream_claim_takes_what_is_held",
        &[writing("rposition(|frame| !all_held.contains(&(frame + 1)))", "rposition(|_| true)")],
        "a_successor_goes_round_what_is_held",
        RACE,
    ),
    broken(
        "stream_takes_the_last_though_it_is_held",
        &[writing("all(|seat| held(seat) != last)", "all(|_| true)")],
        "a_successor_goes_round_what_is_held",
        RACE,
    ),
    broken(
        "stream_without_a_frame_to_write",
        &[ring("self.entries.len() + self.seats.len() + 1", "self.entries.len() + self.seats.len()")],
        "there_always_is_a_free_frame",
        NO_FRAME,
    ),
    broken(
        "stream_without_room_for_holds",
        &[ring("self.entries.len() + self.seats.len() + 1", "self.entries.len() + 1")],
        "a_dead_holder_costs_nothing",
        NO_FRAME,
    ),
    // ---- a successor ----
    broken(
        "stream_counted_before_it_is_written",
        &[writing("        step!(\"publish: filled\");\n", "        ring.count(sequence + 1);\n")],
        "a_successor_writes_what_was_begun",
        LOST,
    ),
    broken(
        "stream_resume_counts_nothing",
        &[writing("let next = named_end(ring, counted);", "let next = counted;")],
        "a_successor_counts_what_was_finished",
        LOST,
    ),
    broken(
        "stream_resume_leaves_half_left_out",
        &[writing("leave_out(ring, sequence, newest, (OmissionCause::Lost, before));", "let _ = (sequence, before);")],
        "a_successor_leaves_out_the_rest",
        "a reader waits for what was left out",
    ),
    broken(
        "stream_no_fence_e_for_what_is_left_out",
        &[writing(
            "when one of these frames is claimed.\n        seq_cst_accesses();",
            "when one of these frames is claimed.",
        )],
        "the_writer_goes_round_what_is_held_and_left_out",
        RACE,
    ),
    broken(
        "stream_leaves_out_and_frees_at_once",
        &[writing(
            "leave_out(ring, at, self.newest, (cause, before(at)))",
            "ring.entry(at).named_frame(ring.frames())",
        )],
        "the_writer_goes_round_what_is_held_and_left_out",
        TORN,
    ),
    // ---- what was left out ----
    broken(
        "stream_left_out_looks_once",
        &[left_out("(entry.word.load(Ordering::Relaxed) == expected).then_some(omission)", "Some(omission)")],
        "what_was_left_out_is_told_by_cause",
        CAUSE,
    ),
    broken(
        "stream_left_out_without_fence_d",
        &[left_out("let about = entry.about();\n        fence(Ordering::Acquire);", "let about = entry.about();")],
        "what_was_left_out_is_told_by_cause",
        CAUSE,
    ),
    broken(
        "stream_left_out_without_acquire_b",
        &[left_out("entry.word.load(Ordering::Acquire) != expected", "entry.word.load(Ordering::Relaxed) != expected")],
        "what_was_left_out_is_told_by_cause",
        CAUSE,
    ),
    broken(
        "stream_all_that_was_left_out_is_lost",
        &[writing("if at < first_sampled {", "if at < sequence {")],
        "what_was_left_out_is_told_by_cause",
        CAUSE,
    ),
    // ---- sleep ----
    broken(
        "stream_drowsy_after_the_last_look",
        &[
            edit("stream_models", "        stream.ring().drowsy(0, 1);\n        reached(\"wait: drowsy\");\n", ""),
            edit(
                "stream_models",
                "            // As the kernel: sleeps",
                "            stream.ring().drowsy(0, 1);\n            // As the kernel: sleeps",
            ),
        ],
        "no_wake_up_is_lost",
        ENDLESS,
    ),
    broken(
        "stream_forgets_the_living",
        &[writing(
            "let _ = self.sleeper.compare_exchange(sleeper, 0, Ordering::Relaxed, Ordering::Relaxed);",
            "self.sleeper.store(0, Ordering::Relaxed);",
        )],
        "a_dead_sleeper_is_forgotten_alone",
        "the living sleeper is not woken",
    ),
    // ---- looking by stamp ----
    broken(
        "stream_final_too_early",
        &[edit("stream/lookup", "newest_ns >= ns.saturating_add(late_ns);", "newest_ns >= ns;")],
        "a_final_answer_stays",
        "was said to be final",
    ),
    broken(
        "stream_any_record_before_will_do",
        &[
            edit("stream/lookup", "(ring, low..line.sequence, Stamp", "(ring, low..line.sequence + 1, Stamp"),
            edit("stream/lookup", "if line.about.stamp == stamp =>", "if line.about.stamp.epoch == stamp.epoch =>"),
        ],
        "an_overwritten_look_says_so",
        "not the nearest",
    ),
];
