//! Programs in other languages, run small: each delivers what it should, a program that fails is told with its own
//! words, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rohrpost_testbed::report::has_two_processors;
use serde_json::{Map, Value};
use support::{FAILED, begin, interrupt, left_behind, rows, run};

/// Case and contender; what the last one says when it could not run here is reported by `rows`.
const ROWS: [(&str, &str); 15] = [
    ("C, blocking", "C"),
    ("C, blocking", "Rust"),
    ("C, spinning", "C"),
    ("C, spinning", "Rust"),
    ("Python, data", "Python"),
    ("Python, data", "Rust"),
    ("Python, data", "iceoryx2"),
    ("Python, data", "zenoh"),
    ("Python, picture", "Python"),
    ("Python, call", "Python"),
    ("Python, call", "Rust"),
    ("Python, remote call", "Python"),
    ("Python, remote call", "sockets + hop"),
    ("Python, remote call", "sockets"),
    ("Python, remote call", "hop"),
];

#[test]
fn every_program_delivers_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("languages", &["--quick", "--json"]);
    let rows = rows(&output);
    for (case, contender) in ROWS {
        let its = |row: &&Map<String, Value>| row["case"] == case && row["contender"] == contender;
        // The parts of a sum that could not be had are not there.
        let is_part = ["sockets", "hop"].contains(&contender);
        let is_skipped = || rows.iter().any(|row| row["contender"] == "sockets + hop" && row["note"].is_string());
        assert!(rows.iter().any(|row| its(&row)) || is_part && is_skipped(), "{case} by {contender}");
    }
    assert_eq!(left_behind(&prefix), [""; 0]);
}

/// An interpreter that finds everything, and runs nothing.
const BROKEN: &str = "#!/bin/sh\n[ \"$2\" = -c ] && exit 0\necho 'it is broken' >&2\nexit 7\n";

#[test]
fn a_program_that_fails_is_told_with_its_own_words() {
    if !has_two_processors() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("python");
    std::fs::write(&python, BROKEN).unwrap();
    std::fs::set_permissions(&python, std::os::unix::fs::PermissionsExt::from_mode(0o700)).unwrap();
    let arguments = ["--quick", "--json", "--only", "Python", "--python", python.to_str().unwrap()];
    let (output, prefix) = run("languages", &arguments);
    assert!(!output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let notes = text.lines().filter(|line| line.contains(FAILED));
    let (right, wrong): (Vec<_>, Vec<_>) = notes.partition(|line| line.contains("it ended with 7; it is broken"));
    assert!(right.len() >= 2 && wrong.is_empty(), "{right:#?} {wrong:#?}");
    assert_eq!(left_behind(&prefix), [""; 0]);
    let (output, _) = run("languages", &["--quick", "--only", "Python, data", "--python", "/no/such/python"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("FAILED: /no/such/python: No such file"), "{text}");
}

#[test]
fn an_interrupt_leaves_no_process() {
    if !has_two_processors() {
        return;
    }
    // Systems, the module, and programs in Python.
    let (child, pids) = begin("languages", "remote", |_, processes| processes > 2);
    interrupt(child, &pids);
}
