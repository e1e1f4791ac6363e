//! Runs of the bench, and what must hold for each line it prints.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_testbed::report;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

/// Prefix of a failed contender's note.
pub(crate) const FAILED: &str = "FAILED";

/// Longer than anything here takes on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A run of this subcommand.
fn bench(subcommand: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rohrpost-bench"));
    command.arg(subcommand).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The rows of a run, each checked, after an end without failure: a message that is damaged, missing or out of order
/// would be one. What could not run here is reported as skipped.
#[track_caller]
pub(crate) fn rows(output: &Output) -> Vec<Map<String, Value>> {
    let text = String::from_utf8_lossy(&output.stdout);
    // Failures come last in long output.
    let (said, failed) = (String::from_utf8_lossy(&output.stderr), failures(output));
    assert!(output.status.success(), "{text}\n{said}\n{failed:#?}");
    let mut lines: Vec<Map<String, Value>> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let (head, tail) = (lines.remove(0), lines.pop().unwrap());
    assert_eq!((&head["case"], &tail["case"]), (&"environment".into(), &"environment-after".into()));
    assert!(head["refused"].is_array() && head["kernel"].is_string());
    lines.iter().for_each(check_row);
    let skipped: BTreeSet<&str> = lines.iter().filter_map(excuse).collect();
    // A loop, since a closure would be the place that is reported.
    for what in skipped {
        report::skipped(what);
    }
    lines
}

/// What a contender may lack here, by words of its note, and what is not tested then. The limits of POSIX queues may be
/// too small without root, a container may forbid tracing or namespaces or have little shared memory, and commands may
/// not have been built.
const EXCUSES: [(&str, &str); 11] = [
    ("bytes of shared memory", "benches: streams of half a gigabyte (shared memory)"),
    ("a POSIX queue of", "benches: POSIX queues that are large enough"),
    ("no process may be traced here", "benches: system calls of a send (ptrace)"),
    ("no namespaces here", "benches: cases on a network (network namespaces)"),
    ("no real time for routers here", "benches: routers with real time"),
    ("no real time here", "benches: deadlines of supervised control (real-time scheduling)"),
    ("name it with --rohrpost", "benches: cases that need the `rohrpost` command"),
    ("--manifest-path benches/zenoh", "benches: zenoh, which is built by hand"),
    ("with --python", "benches: packages for Python, which are installed by hand"),
    ("no C++ compiler", "benches: the search in C++ (`c++`)"),
    ("cargo rustc --release -p rohrpost-c", "benches: programs in C (the library for C)"),
];

/// What is not tested, if this row says that its contender could not run here.
fn excuse(row: &Map<String, Value>) -> Option<&'static str> {
    let note = row["note"].as_str()?.strip_prefix("skipped: ")?;
    EXCUSES.iter().find(|(words, _)| note.contains(words)).map(|(_, what)| *what)
}

/// Its lines of contenders that failed.
fn failures(output: &Output) -> Vec<String> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().filter(|line| line.contains(FAILED)).map(str::to_owned).collect()
}

/// What it printed, and the names that it may use in shared memory.
pub(crate) fn run(subcommand: &str, arguments: &[&str]) -> (Output, String) {
    let child = bench(subcommand, arguments).spawn().unwrap();
    let prefix = prefix(&child);
    (child.wait_with_output().unwrap(), prefix)
}

/// How all names in shared memory begin that this run may use.
pub(crate) fn prefix(child: &Child) -> String {
    format!("rohrpost-bench-{}-", child.id())
}

/// Its remaining names in shared memory.
pub(crate) fn left_behind(prefix: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| name.starts_with(prefix)).collect()
}

/// Waits until the condition holds; fails when that takes too long.
pub(crate) fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
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

/// Units for which zero is allowed.
const COUNTS: [&str; 13] = [
    "a send",
    "a check",
    "%",
    "slots",
    "packages",
    "in 1e5 cycles",
    "us in",
    "ms/s",
    "a second",
    "KiB",
    "of ordinary",
    "of bare",
    "of no junk",
];

/// Keys are there; figures are possible times or rates; ratios are there where both have figures.
fn check_row(row: &Map<String, Value>) {
    let missing: Vec<&&str> = KEYS.iter().filter(|key| !row.contains_key(**key)).collect();
    assert!(missing.is_empty(), "{row:?} lacks {missing:?}");
    let number = |key: &str| row[key].as_f64();
    for key in ["p50", "p99", "p999", "max", "ratio_p50", "ratio_p99"] {
        // Zero is a good count of system calls or losses, but no time and no rate.
        let may_be_0 = COUNTS.iter().any(|unit| row["unit"] == *unit);
        let can_be = |value: f64| value.is_finite() && (value > 0.0 || value == 0.0 && may_be_0);
        assert!(number(key).is_none_or(can_be), "{key} of {row:?}");
    }
    let is_skipped = excuse(row).is_some();
    assert_eq!(number("p50").is_none(), is_skipped, "{row:?}");
    let figures: Vec<f64> = ["p50", "p99", "p999", "max"].into_iter().filter_map(number).collect();
    if row["unit"] == "us" {
        assert!(figures.is_sorted(), "{row:?}");
    }
    // These may be missing where ours is there.
    let may_lack_ratio = ["posix-mq", "zenoh", "iceoryx2", "C++"].iter().any(|other| row["vs"] == *other);
    if !may_lack_ratio && !is_skipped {
        assert_eq!(row["vs"].is_string(), number("ratio_p50").is_some(), "{row:?}");
    }
    let has_target = number("target_p50").or(number("target_p99")).is_some();
    assert!(row["met"].is_null() || has_target, "{row:?}");
}

/// Process ids of its children.
fn children(parent: &Child) -> Vec<String> {
    let list = format!("/proc/{0}/task/{0}/children", parent.id());
    std::fs::read_to_string(list).unwrap_or_default().split_whitespace().map(String::from).collect()
}

/// Begins so many rounds of a case that they do not end, and waits until a turn has its processes.
pub(crate) fn begin(subcommand: &str, case: &str, is_turn: impl Fn(&mut Child, usize) -> bool) -> (Child, Vec<String>) {
    let mut child = bench(subcommand, &["--only", case, "--rounds", "1000"]).spawn().unwrap();
    let mut pids = Vec::new();
    wait_for("a turn", || {
        pids = children(&child);
        is_turn(&mut child, pids.len())
    });
    (child, pids)
}

/// Whether none of these is still a process of the bench.
pub(crate) fn are_gone(pids: &[String]) -> bool {
    !pids.iter().any(|pid| {
        let name = std::fs::read_to_string(Path::new("/proc").join(pid).join("comm")).unwrap_or_default();
        name.starts_with("rohrpost")
    })
}

/// Interrupts a run that has these processes: it ends, and leaves none of them, and nothing in shared memory.
pub(crate) fn interrupt(mut child: Child, pids: &[String]) {
    assert!(!end(&mut child, Signal::SIGINT).success());
    assert_eq!(left_behind(&prefix(&child)), [""; 0]);
    wait_for("the processes to end", || are_gone(pids));
}

/// Sends it a signal, and waits for its end.
pub(crate) fn end(child: &mut Child, signal: Signal) -> ExitStatus {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
    child.wait().unwrap()
}
