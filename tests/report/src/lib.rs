//! What tests of all crates share: how they wait, and the report of what they did not test and what they tried again,
//! so that a run does not hide it.
//!
//! Each report goes to stderr past the test harness, which keeps what passing tests print to itself, and as a line to
//! the file that [`FILE`] names, if it does: `skipped` or `repeated`, the place in the source, the reason; tabs in
//! between. `cargo xtask test` prints all of them last, and fails if there are more than the repository allows.

#![forbid(unsafe_code)]

use std::fmt::Debug;
use std::fs::OpenOptions;
use std::io::Write;
use std::panic::Location;
use std::time::{Duration, Instant};

/// Limit of all waits, long enough for a busy computer.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until there is a value, and fails with the name of what was awaited.
#[track_caller]
pub fn wait<T>(what: impl Debug, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited {PATIENCE:?} in vain: {what:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until this is so, and fails with the name of what was awaited.
#[track_caller]
pub fn until(what: impl Debug, mut is_so: impl FnMut() -> bool) {
    wait(what, || is_so().then_some(()));
}

/// Environment variable with the file's path.
pub const FILE: &str = "ROHRPOST_TEST_REPORT";

/// A test cannot test this here: something is missing, or not allowed.
#[track_caller]
pub fn skipped(what: &str) {
    skipped_at(Location::caller(), what);
}

/// The same, of a test at another place.
pub fn skipped_at(place: &Location<'_>, what: &str) {
    say("skipped", place, what);
}

/// Whether what is measured between two processors can be tested here. If not, the caller's test leaves it out.
#[track_caller]
pub fn has_two_processors() -> bool {
    let has = std::thread::available_parallelism().is_ok_and(|processors| processors.get() >= 2);
    if !has {
        skipped("measuring between two processors, of which there is one");
    }
    has
}

/// A test runs once more, for this reason.
pub fn repeated(place: &Location<'_>, why: &str) {
    say("repeated", place, why);
}

fn say(kind: &str, place: &Location<'_>, text: &str) {
    let text = text.replace(['\n', '\t'], " ");
    let _ = writeln!(std::io::stderr(), "{}, {}:{}: {text}", kind.to_uppercase(), place.file(), place.line());
    let Some(path) = std::env::var_os(FILE) else { return };
    // One write to a file that is opened to append: lines of several processes do not mix.
    let line = format!("{kind}\t{}:{}\t{text}\n", place.file(), place.line());
    let written =
        OpenOptions::new().create(true).append(true).open(&path).and_then(|mut file| file.write_all(line.as_bytes()));
    assert!(written.is_ok(), "the report of the tests cannot be written to {}: {written:?}", path.display());
}
