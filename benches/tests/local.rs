//! All cases, run small: every contender delivers what it should, every line says what it has to, and nothing is left
//! behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use nix::sys::signal::Signal;
use rohrpost_testbed::report::has_two_processors;
use std::process::Child;
use support::{are_gone, begin, end, interrupt, left_behind, prefix, rows, run, wait_for};

/// The latency cases: sizes, and the contenders besides ours.
const CASES: [(&str, &[u64], &[&str]); 8] = [
    ("blocking", &[64, 1024, 16_384, 62_000], &["futex", "posix-mq", "iceoryx2 listener"]),
    ("one-core", &[64], &["futex", "posix-mq", "iceoryx2 listener"]),
    ("spinning", &[64, 1024, 16_384], &["spin", "slot core", "iceoryx2 spinning", "crossbeam, 1 process"]),
    ("loaned", &[64, 1024, 16_384, 62_000], &["spin 64 B", "iceoryx2 loaned"]),
    ("blocking, default scheduler", &[64], &["futex", "posix-mq"]),
    ("spinning, default scheduler", &[64], &["spin"]),
    ("blocking, paced", &[64], &["futex", "posix-mq"]),
    ("spinning, paced", &[64], &["spin"]),
];

#[test]
fn every_contender_delivers_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("local", &["--quick", "--json"]);
    let rows = rows(&output);
    for (case, sizes, others) in CASES {
        for bytes in sizes {
            let rows = || rows.iter().filter(|row| row["case"] == case && row["bytes"] == *bytes);
            for other in others {
                assert_eq!(rows().filter(|row| row["contender"] == *other).count(), 1, "{case} {bytes} {other}");
                assert_eq!(rows().filter(|row| row["vs"] == *other).count(), 1, "{case} {bytes} beside {other}");
            }
            assert_eq!(rows().count(), 2 * others.len(), "{case} {bytes}");
        }
    }
    assert_eq!(left_behind(&prefix), [""; 0]);
}

#[test]
fn people_get_a_table_of_the_cases_they_ask_for() {
    let (output, _) = run("local", &["--quick", "--only", "one-core"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let cases = text.lines().filter(|line| line.starts_with(" one-core ")).count();
    assert_eq!((output.status.success(), cases), (true, 6), "{text}");
    assert!(text.starts_with("processor ") && !text.contains("loaned") && text.contains("load afterwards"), "{text}");
    assert!(text.contains("met") || text.contains("MISSED"), "{text}");
}

#[test]
fn a_case_that_is_none_is_refused() {
    let (output, _) = run("local", &["--quick", "--only", "one-core", "no-such-case"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && said.contains("`no-such-case`") && said.contains("one-core"), "{said}");
}

/// Begins a run, and waits until a turn has made something in shared memory.
fn begun() -> (Child, Vec<String>) {
    let (child, pids) = begin("local", "blocking", |_, processes| processes == 2);
    wait_for("something in shared memory", || !left_behind(&prefix(&child)).is_empty());
    (child, pids)
}

#[test]
fn an_interrupt_leaves_nothing() {
    let (child, pids) = begun();
    interrupt(child, &pids);
}

#[test]
fn what_a_killed_run_left_goes_with_the_next_one() {
    let (mut child, pids) = begun();
    end(&mut child, Signal::SIGKILL);
    wait_for("the processes to end", || are_gone(&pids));
    assert!(run("local", &["--quick", "--only", "one-core"]).0.status.success());
    assert_eq!(left_behind(&prefix(&child)), [""; 0]);
}
