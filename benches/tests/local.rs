//! All cases, run small: every contender delivers what it should, every line says what it has to, and nothing is left behind.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Map, Value};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Longer than anything here takes on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

fn bench(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rohrpost-bench"));
    command.arg("local").args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What it printed, and the names that it may use in shared memory.
fn run(arguments: &[&str]) -> (Output, String) {
    let child = bench(arguments).spawn().unwrap();
    let prefix = prefix(&child);
    (child.wait_with_output().unwrap(), prefix)
}

fn prefix(child: &Child) -> String {
    format!("rohrpost-bench-{}-", child.id())
}

fn left_behind(prefix: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| name.starts_with(prefix)).collect()
}

fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < deadline, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

const KEYS: [&str; 13] = [
    "case",
    "bytes",
    "unit",
    "p50",
    "p99",
    "p999",
    "max",
    "vs",
    "ratio_p50",
    "ratio_p99",
    "target_p50",
    "target_p99",
    "met",
];

/// The latency cases: sizes, and who is in it besides ours.
const CASES: [(&str, &[u64], &[&str]); 8] = [
    ("blocking", &[64, 1024, 16_384, 62_000], &["futex", "posix-mq", "iceoryx2 listener"]),
    ("one-core", &[64], &["futex", "posix-mq", "iceoryx2 listener"]),
    ("spinning", &[64, 1024, 16_384], &["spin", "iceoryx2 spinning", "crossbeam, 1 process"]),
    ("loaned", &[64, 1024, 16_384, 62_000], &["spin 64 B", "iceoryx2 loaned"]),
    ("blocking, default scheduler", &[64], &["futex", "posix-mq"]),
    ("spinning, default scheduler", &[64], &["spin"]),
    ("blocking, paced", &[64], &["futex", "posix-mq"]),
    ("spinning, paced", &[64], &["spin"]),
];

#[test]
fn every_contender_delivers_and_every_line_is_complete() {
    let (output, prefix) = run(&["--quick", "--json"]);
    let text = String::from_utf8(output.stdout).unwrap();
    // A message that is damaged, missing or out of order would have failed it.
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    let lines: Vec<Map<String, Value>> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let (head, rest) = lines.split_first().unwrap();
    let (tail, rows) = rest.split_last().unwrap();
    assert_eq!((&head["case"], &tail["case"]), (&"environment".into(), &"environment-after".into()));
    assert!(head["refused"].is_array() && head["kernel"].is_string());
    rows.iter().for_each(check_row);
    for (case, sizes, others) in CASES {
        for bytes in sizes {
            let rows = || rows.iter().filter(|row| row["case"] == case && row["bytes"] == *bytes);
            for other in others {
                assert_eq!(rows().filter(|row| row["who"] == *other).count(), 1, "{case} {bytes} {other}");
                assert_eq!(rows().filter(|row| row["vs"] == *other).count(), 1, "{case} {bytes} beside {other}");
            }
            assert_eq!(rows().count(), 2 * others.len(), "{case} {bytes}");
        }
    }
    assert_eq!(left_behind(&prefix), [""; 0]);
}

/// Keys are there; figures are times or rates that can be; ratios are there where both have figures.
fn check_row(row: &Map<String, Value>) {
    let missing: Vec<&&str> = KEYS.iter().filter(|key| !row.contains_key(**key)).collect();
    assert!(missing.is_empty(), "{row:?} lacks {missing:?}");
    let number = |key: &str| row[key].as_f64();
    for key in ["p50", "p99", "p999", "max", "ratio_p50", "ratio_p99"] {
        // Nothing is a good count, of system calls say; no time and no rate is nothing.
        let can_be = |value: f64| value.is_finite() && (value > 0.0 || value == 0.0 && row["unit"] == "a send");
        assert!(number(key).is_none_or(can_be), "{key} of {row:?}");
    }
    // The limits of POSIX queues may be too small for whoever is not root, a container may forbid tracing, and the command may
    // not have been built.
    let excuses = ["a POSIX queue of", "no process may be traced here", "name it with --rohrpost"];
    let is_skipped = row["note"].as_str().is_some_and(|note| excuses.iter().any(|excuse| note.contains(excuse)));
    assert_eq!(number("p50").is_none(), is_skipped, "{row:?}");
    let figures: Vec<f64> = ["p50", "p99", "p999", "max"].into_iter().filter_map(number).collect();
    if row["unit"] == "us" {
        assert!(figures.is_sorted(), "{row:?}");
    }
    if row["vs"] != "posix-mq" && !is_skipped {
        assert_eq!(row["vs"].is_string(), number("ratio_p50").is_some(), "{row:?}");
    }
    let has_target = number("target_p50").or(number("target_p99")).is_some();
    assert!(row["met"].is_null() || has_target, "{row:?}");
}

#[test]
fn people_get_a_table_of_the_cases_they_ask_for() {
    let (output, _) = run(&["--quick", "--only", "one-core"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let cases = text.lines().filter(|line| line.starts_with(" one-core ")).count();
    assert_eq!((output.status.success(), cases), (true, 6), "{text}");
    assert!(text.starts_with("processor ") && !text.contains("loaned") && text.contains("load afterwards"), "{text}");
    assert!(text.contains("met") || text.contains("MISSED"), "{text}");
}

#[test]
fn a_case_that_is_none_is_refused() {
    let (output, _) = run(&["--quick", "--only", "one-core", "no-such-case"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && said.contains("`no-such-case`") && said.contains("one-core"), "{said}");
}

/// Starts a run and waits until it has made something in shared memory.
fn begun() -> (Child, String) {
    let child = bench(&["--only", "blocking", "--rounds", "1000"]).spawn().unwrap();
    let prefix = prefix(&child);
    wait_for("a turn to begin", || left_behind(&prefix).len() > 1 || !children(&child).is_empty());
    wait_for("something in shared memory", || !left_behind(&prefix).is_empty());
    (child, prefix)
}

fn children(parent: &Child) -> Vec<String> {
    let list = format!("/proc/{0}/task/{0}/children", parent.id());
    std::fs::read_to_string(list).unwrap_or_default().split_whitespace().map(String::from).collect()
}

fn are_gone(pids: &[String]) -> bool {
    !pids.iter().any(|pid| {
        let name = std::fs::read_to_string(Path::new("/proc").join(pid).join("comm")).unwrap_or_default();
        name.starts_with("rohrpost-bench")
    })
}

fn signal(child: &Child, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
}

#[test]
fn whoever_interrupts_it_finds_nothing_left() {
    let (mut child, prefix) = begun();
    let pids = children(&child);
    signal(&child, Signal::SIGINT);
    assert!(!child.wait().unwrap().success());
    assert_eq!(left_behind(&prefix), [""; 0]);
    wait_for("the processes to end", || are_gone(&pids));
}

#[test]
fn what_a_killed_run_left_goes_with_the_next_one() {
    let (mut child, prefix) = begun();
    let mut pids = Vec::new();
    wait_for("both ends", || {
        pids = children(&child);
        pids.len() == 2
    });
    signal(&child, Signal::SIGKILL);
    child.wait().unwrap();
    wait_for("the processes to end", || are_gone(&pids));
    assert!(run(&["--quick", "--only", "one-core"]).0.status.success());
    assert_eq!(left_behind(&prefix), [""; 0]);
}
