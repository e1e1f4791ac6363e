//! The cases with time slots, run small: each runs, every line is complete, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rohrpost_testbed::report;
use serde_json::{Map, Value};
use std::process::Child;
use support::{FAILED, begin, interrupt, left_behind, prefix, rows, run};

/// A row of each case that exists whenever the case could run, and its contender.
const ROWS: [(&str, &str); 21] = [
    ("slots", "loaded"),
    ("slots", "unloaded"),
    ("slots", "ordinary"),
    ("slots, omitted", "loaded"),
    ("slots, outside its own", "loaded"),
    ("slots, in another's slot", "loaded"),
    ("slots, left out or over 250 us off", "loaded"),
    ("cycle-1ms", "loaded"),
    ("pitch, into the guard", "250 us, guard 80"),
    ("pitch, not kept", "250 us, guard 80"),
    ("clock", "rohrpost"),
    ("clock", "RTnet's formula"),
    ("holdover", "after 1 s"),
    ("takeover, replacement", "the first dies"),
    ("takeover, new master", "the second dies"),
    ("takeover, cycles without Sync", "quiet"),
    ("flows, urgent, p99.9", "measured"),
    ("flows, lost", "all"),
    ("replicas, records", "beside replicas"),
    ("replicas, urgent", "beside replicas"),
    ("replicas, packages lost", "without"),
];

/// The case of a row.
fn case_of(row: &Map<String, Value>) -> String {
    row["case"].as_str().unwrap().split(',').next().unwrap().into()
}

#[test]
fn every_case_runs_and_every_line_is_complete() {
    if !report::has_two_processors() {
        return;
    }
    let (output, prefix) = run("tdma", &["--quick", "--json"]);
    let rows = rows(&output);
    for (case, contender) in ROWS {
        let own = || rows.iter().filter(|row| case_of(row) == case.split(',').next().unwrap());
        // Without namespaces, real-time scheduling or the command, a note says so, which `rows` has reported. A
        // failure is no excuse.
        let is_skipped = own().any(|row| row["note"].as_str().is_some_and(|note| note.starts_with("skipped: ")));
        let is_there = rows.iter().any(|row| row["case"] == case && row["contender"] == contender);
        assert!(is_there || is_skipped, "{case} by {contender}");
        assert!(own().next().is_some(), "{case}");
    }
    let failed = rows.iter().find(|row| row["note"].as_str().is_some_and(|note| note.starts_with(FAILED)));
    assert_eq!(failed, None);
    // Whatever was declared arrived.
    let lost = rows.iter().filter(|row| row["case"] == "flows, lost" || row["case"] == "replicas, packages lost");
    lost.for_each(|row| assert_eq!(row["p50"], 0.0, "{row:?}"));
    assert_eq!(left_behind(&prefix), [""; 0]);
}

#[test]
fn an_interrupt_leaves_no_process() {
    // Routers, capture and feeders; without a command or namespaces it ends by itself.
    let has_ended = |child: &mut Child| child.try_wait().unwrap().is_some();
    let (mut child, pids) = begin("tdma", "slots", |child, processes| processes > 2 || has_ended(child));
    if !has_ended(&mut child) {
        interrupt(child, &pids);
    } else {
        report::skipped("benches: an interrupt of cases with time slots");
        assert_eq!(left_behind(&prefix(&child)), [""; 0]);
    }
}
