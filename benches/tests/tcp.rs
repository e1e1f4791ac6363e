//! The cases of the TCP router, run small: each runs, every line is complete, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rohrpost_testbed::report::has_two_processors;
use serde_json::{Map, Value};
use support::{FAILED, begin, interrupt, left_behind, rows, run};

/// A row that exists whenever its case could run: case and contender.
const ROWS: [(&str, &str); 18] = [
    ("hop", "rohrpost"),
    ("hop", "relays"),
    ("hop", "relays of mailboxes"),
    ("hop", "zenoh"),
    ("hop, sealed", "rohrpost"),
    ("hop, sealed", "not sealed"),
    ("clients", "rohrpost"),
    ("clients, rate", "rohrpost"),
    ("clients, lost", "rohrpost"),
    ("clients, steal", "rohrpost"),
    ("clients, run delay", "rohrpost"),
    ("clients, sealed", "not sealed"),
    ("clients, one stalled", "rohrpost"),
    ("clients, one stalled", "none stalled"),
    ("clients, hostile beside", "rohrpost"),
    ("clients, hostile beside, connections beside", "rohrpost"),
    ("idle client", "rohrpost"),
    ("idle client, sealed", "rohrpost"),
];

#[test]
fn every_case_runs_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("tcp", &["--quick", "--json"]);
    let rows = rows(&output);
    for (case, contender) in ROWS {
        let is_there = rows.iter().any(|row| row["case"] == case && row["contender"] == contender);
        // Without a command, ours has one row that says so, which `rows` has reported, and no other figures. A
        // failure is no excuse.
        let is_skipped = |row: &Map<String, Value>| {
            let is_own = case.starts_with(row["case"].as_str().unwrap()) && row["contender"] == contender;
            is_own && row["note"].as_str().is_some_and(|note| note.starts_with("skipped: "))
        };
        assert!(is_there || rows.iter().any(is_skipped), "{case} by {contender}");
    }
    let failed = rows.iter().find(|row| row["note"].as_str().is_some_and(|note| note.starts_with(FAILED)));
    assert_eq!(failed, None);
    // So few packages find room everywhere.
    let lost = rows.iter().filter(|row| row["case"].as_str().unwrap().ends_with(", lost"));
    lost.for_each(|row| assert_eq!(row["p50"], 0.0, "{row:?}"));
    assert_eq!(left_behind(&prefix), [""; 0]);
}

#[test]
fn an_interrupt_leaves_no_process() {
    // Systems, relays and modules.
    let (child, pids) = begin("tcp", "hop", |_, processes| processes > 2);
    interrupt(child, &pids);
}
