//! The cases of planning, run small: every line says what it has to, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[allow(dead_code, reason = "no run of seconds is interrupted")]
mod support;

use support::{left_behind, rows, run};

#[test]
fn every_case_runs_and_stands_beside_its_target() {
    let (output, prefix) = run("plan", &["--quick", "--json"]);
    let all = rows(&output);
    let ours: Vec<_> = all.iter().filter(|row| row["contender"] == "rohrpost").collect();
    let told = ours.iter().map(|row| (row["case"].as_str().unwrap(), row["vs"].as_str().unwrap()));
    let expected = [("ways of 64, 32 x 32, time", "50 ms"), ("ways of 64, 32 x 32, steps", "1.3 x alone")];
    assert_eq!(told.collect::<Vec<_>>(), expected);
    let ratio = ours[1]["p50"].as_f64().unwrap();
    assert!((1.0..=1.3).contains(&ratio), "a count, and no time: it is the same on each computer: {ratio}");
    assert_eq!(left_behind(&prefix), [""; 0]);
}
