//! The cases of teams, run small: every line says what it has to, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[allow(dead_code, reason = "no run of seconds is interrupted")]
mod support;

use support::{left_behind, rows, run};

#[test]
fn every_case_runs_and_stands_beside_its_bound() {
    let (output, prefix) = run("team", &["--quick", "--json"]);
    let all = rows(&output);
    let ours: Vec<_> = all.iter().filter(|row| row["contender"] == "rohrpost").collect();
    let told = ours.iter().map(|row| (row["case"].as_str().unwrap(), row["vs"].as_str().unwrap()));
    let expected = [
        ("hello of 64, bytes", "96, and 12 a robot"),
        ("hello of 64, handled", "decoding"),
        ("views of 1000, join", "sorting one"),
        ("merge of 20, 10 % loss", "1.5 s"),
        ("team hop", "hop of a LAN"),
        ("team hop", "hop of a LAN"),
        ("64 robots, 2 Hz", "bare datagrams"),
    ];
    assert_eq!(told.collect::<Vec<_>>(), expected);
    assert_eq!(ours[0]["p50"], 96.0 + 63.0 * 12.0, "a count, and no time: it is the same on each computer");
    for row in ours {
        assert!(row["target_p50"].is_number() || row["target_p99"].is_number(), "{row:?}");
    }
    assert_eq!(left_behind(&prefix), [""; 0]);
}
