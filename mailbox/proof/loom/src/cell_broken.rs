//! The names of the cells' models, and the variants of `cell.rs` that must fail in one of them.

use super::broken::{Broken, Edit, broken};

/// Each model and the bound on its preemptions.
pub(crate) const MODELS: &[(&str, usize)] = &[
    ("a_value_is_read_whole", 3),
    ("a_successor_completes_what_the_dead_left", 3),
    ("a_latched_value_is_read_whole", 3),
    ("a_latched_value_stays_readable", 3),
    ("a_latched_value_outlives_its_writer", 3),
];

const TORN: &str = "torn";
const OTHER_VERSION: &str = "a value of another version";

const fn edit(from: &'static str, to: &'static str) -> Edit {
    rohrpost_planted::edit("cell", from, to)
}

pub(crate) const BROKEN: &[Broken] = &[
    // ---- in place: (A) to (D) ----
    broken(
        "count_never_odd",
        &[edit("        self.0.store(inside, Ordering::Relaxed);\n", "")],
        "a_value_is_read_whole",
        TORN,
    ),
    broken(
        "count_without_fence_a",
        &[edit("        fence(Ordering::Release);\n        step!(\"cell: inside\");", "step!(\"cell: inside\");")],
        "a_value_is_read_whole",
        TORN,
    ),
    broken(
        "count_without_fence_b",
        &[edit("        fence(Ordering::Acquire);\n        (self.0", "        (self.0")],
        "a_value_is_read_whole",
        TORN,
    ),
    broken(
        "count_without_release_c",
        &[edit("inside.wrapping_add(1), Ordering::Release", "inside.wrapping_add(1), Ordering::Relaxed")],
        "a_value_is_read_whole",
        OTHER_VERSION,
    ),
    broken(
        "count_without_acquire_d",
        &[edit("let version = self.0.load(Ordering::Acquire)", "let version = self.0.load(Ordering::Relaxed)")],
        "a_value_is_read_whole",
        OTHER_VERSION,
    ),
    broken(
        "count_read_while_odd",
        &[edit("if !version.is_multiple_of(2) {", "if false {")],
        "a_value_is_read_whole",
        OTHER_VERSION,
    ),
    broken(
        "count_read_once",
        &[edit("(self.0.load(Ordering::Relaxed) == version).then_some", "true.then_some")],
        "a_value_is_read_whole",
        TORN,
    ),
    // The successor makes the number even while it is inside, and odd when it has ended.
    broken(
        "count_adds_to_the_dead",
        &[edit("self.0.load(Ordering::Relaxed) | 1;", "self.0.load(Ordering::Relaxed) + 1;")],
        "a_successor_completes_what_the_dead_left",
        "assertion",
    ),
    // ---- two places: (E) to (H) ----
    broken(
        "latch_without_fence_e",
        &[edit("        fence(Ordering::Release);\n        store(", "        store(")],
        "a_latched_value_is_read_whole",
        TORN,
    ),
    broken(
        "latch_without_fence_f",
        &[edit("            fence(Ordering::Acquire);\n", "")],
        "a_latched_value_is_read_whole",
        TORN,
    ),
    broken(
        "latch_without_release_g",
        &[edit("self.0.store(next, Ordering::Release)", "self.0.store(next, Ordering::Relaxed)")],
        "a_latched_value_is_read_whole",
        "0 was never published",
    ),
    broken(
        "latch_without_acquire_h",
        &[edit("let index = self.0.load(Ordering::Acquire)", "let index = self.0.load(Ordering::Relaxed)")],
        "a_latched_value_is_read_whole",
        "0 was never published",
    ),
    broken(
        "latch_read_once",
        &[edit("if self.0.load(Ordering::Relaxed) == index {", "if true {")],
        "a_latched_value_is_read_whole",
        TORN,
    ),
    broken(
        "latch_fills_the_valid_place",
        &[edit("store((next % 2) as usize)", "store(((next + 1) % 2) as usize)")],
        "a_latched_value_stays_readable",
        "assertion",
    ),
    broken(
        "latch_published_before_it_is_filled",
        &[edit("        store((next % 2) as usize);", "        self.publish(); store((next % 2) as usize);")],
        "a_latched_value_outlives_its_writer",
        TORN,
    ),
];
