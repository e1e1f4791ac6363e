//! The cases of streams, run small: every contender delivers what it should, every line says what it has to, and
//! nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use nix::sys::signal::Signal;
use rohrpost_testbed::report::has_two_processors;
use support::{are_gone, begin, end, interrupt, left_behind, prefix, rows, run, wait_for};

/// Case, bytes of a record, contenders that ours is compared with, and others.
type Rows = (&'static str, Option<u64>, &'static [&'static str], &'static [&'static str]);

const CASES: [Rows; 10] = [
    ("spinning", Some(64), &["spin"], &[]),
    ("blocking", Some(64), &["futex"], &[]),
    ("in-place", Some(65_536), &["rohrpost, 64 B", "iceoryx2 loaned"], &[]),
    ("in-place", Some(1_048_576), &["rohrpost, 64 B", "iceoryx2 loaned"], &[]),
    ("in-place", Some(8_388_608), &["rohrpost, 64 B", "iceoryx2 loaned"], &[]),
    ("copied", Some(1_048_576), &["two memcpy"], &[]),
    ("cost-of-write", Some(64), &["no reader"], &["1 sleeps", "8 sleep"]),
    ("cost-of-write, paced", Some(64), &["no reader"], &["1 sleeps", "8 sleep"]),
    ("rate", Some(64), &["ring"], &[]),
    ("around", None, &["binary search", "1000 records"], &[]),
];
/// The case that needs half a gigabyte, which not every computer has to give.
const OPEN_BYTES: u64 = 512 << 20;

#[test]
fn every_contender_delivers_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("streams", &["--quick", "--json"]);
    let all = rows(&output);
    for (case, bytes, compared, beside) in CASES {
        let rows = || all.iter().filter(|row| row["case"] == case && row["bytes"].as_u64() == bytes);
        for other in compared.iter().chain(beside) {
            assert_eq!(rows().filter(|row| row["contender"] == *other).count(), 1, "{case} {bytes:?} {other}");
        }
        for other in compared {
            assert_eq!(rows().filter(|row| row["vs"] == *other).count(), 1, "{case} {bytes:?} beside {other}");
        }
        assert_eq!(rows().count(), 2 * compared.len() + beside.len(), "{case} {bytes:?}");
    }
    let opened = all.iter().filter(|row| row["case"] == "open" && row["bytes"] == OPEN_BYTES).count();
    assert_eq!(opened, 2);
    let cases: usize = CASES.iter().map(|(_, _, compared, beside)| 2 * compared.len() + beside.len()).sum();
    assert_eq!(all.len(), cases + opened, "a case is not in the table above");
    assert_eq!(left_behind(&prefix), [""; 0]);
}

#[test]
fn an_interrupt_leaves_nothing() {
    // The writer, and eight readers.
    let (child, pids) = begin("streams", "cost-of-write", |_, processes| processes == 9);
    interrupt(child, &pids);
}

#[test]
fn what_a_killed_run_left_goes_with_the_next_one() {
    let (mut child, pids) = begin("streams", "blocking", |_, processes| processes == 2);
    wait_for("something in shared memory", || !left_behind(&prefix(&child)).is_empty());
    end(&mut child, Signal::SIGKILL);
    wait_for("the processes to end", || are_gone(&pids));
    let prefix = prefix(&child);
    assert!(run("streams", &["--quick", "--only", "rate"]).0.status.success());
    assert_eq!(left_behind(&prefix), [""; 0]);
}
