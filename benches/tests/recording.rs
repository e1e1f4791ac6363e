//! The cases of recordings, run small: every contender records what it should, every line says what it has to, and
//! nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use nix::sys::signal::Signal;
use rohrpost_testbed::report::has_two_processors;
use std::process::Child;
use support::{are_gone, begin, end, interrupt, left_behind, prefix, rows, run, wait_for};

const SIZES: [u64; 4] = [100, 1000, 62_000, 4 << 20];

#[test]
fn every_contender_records_all_and_every_line_is_complete() {
    if !has_two_processors() {
        return;
    }
    let (output, prefix) = run("recording", &["--quick", "--json"]);
    let all = rows(&output);
    for case in ["recorded", "recorded, processor"] {
        for bytes in SIZES {
            let of: Vec<_> = all.iter().filter(|row| row["case"] == case && row["bytes"] == bytes).collect();
            assert_eq!(of.len(), 2, "{case} {bytes}: {of:?}");
            assert!(of[0]["contender"] == "rohrpost" && of[0]["vs"] == "mcap" && of[1]["contender"] == "mcap");
        }
    }
    let beside: Vec<_> = all.iter().filter(|row| row["case"] == "pair beside 50 MB/s recorded").collect();
    assert_eq!(beside.len(), 2, "{beside:?}");
    assert!(beside[0]["contender"] == "rohrpost" && beside[0]["vs"] == "without recorder", "{beside:?}");
    for (case, beside, contenders, is_median) in [
        ("event with journal, on one processor", "without journal", 2, true),
        ("event with journal, on two processors", "without journal", 2, true),
        ("exact replay of the demo", "real time", 2, true),
        // With the same without waits for a processor.
        ("replay, error of spacing", "1 ms", 3, false),
    ] {
        let of: Vec<_> = all.iter().filter(|row| row["case"] == case).collect();
        assert_eq!(of.len(), contenders, "{case}: {of:?}");
        assert!(of[0]["contender"] == "rohrpost" && of[0]["vs"] == beside && of[1]["contender"] == beside, "{of:?}");
        let targets = [&of[0]["target_p50"], &of[0]["target_p99"]].map(serde_json::Value::is_number);
        assert_eq!(targets, [is_median, !is_median], "{of:?}");
    }
    assert_eq!(all.len(), 4 * SIZES.len() + 11, "a case is not in the table above");
    assert_eq!(left_behind(&prefix), [""; 0]);
}

/// Begins a run, and waits until a turn has its process, and the folder with the recording.
fn begun() -> (Child, Vec<String>) {
    let (child, pids) = begin("recording", "recorded", |_, processes| processes == 1);
    wait_for("its folder", || !left_behind(&prefix(&child)).is_empty());
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
    assert!(run("recording", &["--quick", "--only", "processor"]).0.status.success());
    assert_eq!(left_behind(&prefix(&child)), [""; 0]);
}
