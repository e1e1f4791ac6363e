//! The cases of supervised control, run small: each runs, every line is complete, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rohrpost_testbed::report::has_two_processors;
use support::{begin, interrupt, left_behind, rows, run};

/// Case, the contender that ours is compared with, whether its median and its 99 % quantile have a target, and a
/// contender that is told beside them.
const CASES: [(&str, &str, [bool; 2], Option<&str>); 7] = [
    ("promise to the motor", "hop", [true, true], None),
    ("envelope of 360 beams", "sin_cos of each beam", [false, true], Some("Nav2's step, published")),
    ("envelope, heap uses", "copy of the scan", [true, false], None),
    ("deadline to the brake", "timer and hop", [false, true], None),
    ("deadline to the brake, flooded", "not flooded", [false, true], None),
    ("hand-over with watchdog", "without watchdog", [true, false], None),
    ("hang to its end", "100 ms", [false, true], None),
];

#[test]
fn every_case_runs_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("supervision", &["--quick", "--json"]);
    let all = rows(&output);
    for (case, other, targets, beside) in CASES {
        let of: Vec<_> = all.iter().filter(|row| row["case"] == case).collect();
        let contenders: Vec<_> = of.iter().map(|row| row["contender"].as_str().unwrap()).collect();
        assert_eq!(contenders, ["rohrpost", other].into_iter().chain(beside).collect::<Vec<_>>(), "{case}");
        assert_eq!(of[0]["vs"], other, "{case}");
        let has = [&of[0]["target_p50"], &of[0]["target_p99"]].map(serde_json::Value::is_number);
        assert_eq!(has, targets, "{case}");
    }
    let rows_of_cases: usize = CASES.iter().map(|(_, _, _, beside)| 2 + beside.iter().count()).sum();
    assert_eq!(all.len(), rows_of_cases, "a case is not in the table above");
    let heap_uses = all.iter().find(|row| row["case"] == "envelope, heap uses").unwrap();
    assert_eq!(heap_uses["p50"], 0.0, "a count, and no time: it is the same on each computer");
    assert_eq!(left_behind(&prefix), [""; 0]);
}

#[test]
fn an_interrupt_leaves_no_process() {
    // Launch, and what commands its module. The module ends with launch.
    let (child, pids) = begin("supervision", "hang", |_, processes| processes == 2);
    interrupt(child, &pids);
}
