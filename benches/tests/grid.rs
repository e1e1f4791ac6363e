//! The cases of grids, run small: both search alike, every line says what it has to, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[allow(dead_code, reason = "no run of seconds is interrupted")]
mod support;

use support::{left_behind, rows, run};

#[test]
fn every_wave_is_measured_beside_its_floor() {
    let (output, prefix) = run("grid", &["--quick", "--json"]);
    let all = rows(&output);
    let contenders: Vec<_> =
        all.iter().map(|row| (row["case"].as_str().unwrap(), row["contender"].as_str().unwrap())).collect();
    let cases = ["wave, empty", "wave, 20 % walls", "wave, rooms"];
    assert_eq!(contenders, cases.map(|case| [(case, "rohrpost"), (case, "C++")]).concat());
    assert!(all.iter().step_by(2).all(|row| row["vs"] == "C++" && row["target_p50"] == 1.3), "{all:?}");
    assert_eq!(left_behind(&prefix), [""; 0]);
}
