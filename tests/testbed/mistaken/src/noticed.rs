//! The routers' own tests notice the mistakes: each in a process of its own that makes one mistake all the time. In the
//! copy without a mistake they pass, so a mistake it is that they notice.

use crate::catalog::GROUPS;
use crate::catalog::planted::{IN_NETWORKS, Planted};
use crate::mistakes::MISTAKE_VARIABLE;
use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::sync::Mutex;

/// Where the random cases of proptest begin: the same in each run, so a mistake that they notice is noticed always.
const CASES: &str = "1";

/// What came of a copied test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Verdict {
    Passed,
    Failed,
    /// It is not there, or could not run.
    Unknown,
}

/// Runs one of the copied tests, which are ignored otherwise.
fn run(test: &str, mistake: Option<&str>) -> Verdict {
    let mut command = Command::new(std::env::current_exe().expect("a test has a file"));
    command.args(["--exact", test, "--ignored", "--test-threads=1"]).env_remove(MISTAKE_VARIABLE);
    command.env("PROPTEST_RNG_SEED", CASES);
    mistake.map(|name| command.env(MISTAKE_VARIABLE, name));
    let output = command.stdin(Stdio::null()).output().expect("a test can be run");
    let text = String::from_utf8_lossy(&output.stdout);
    match text.lines().find_map(|line| line.strip_prefix("test result: ")) {
        Some(result) if result.starts_with("ok. 1 passed; 0 failed;") => Verdict::Passed,
        Some(result) if result.starts_with("FAILED. 0 passed; 1 failed;") => Verdict::Failed,
        _ => Verdict::Unknown,
    }
}

fn notices(planted: &Planted) -> Result<(), String> {
    match run(planted.shows_in, Some(planted.name)) {
        Verdict::Failed => Ok(()),
        verdict => Err(format!("{}: {verdict:?} with {}: {}", planted.shows_in, planted.name, planted.text)),
    }
}

fn passes(test: &str) -> Result<(), String> {
    match run(test, None) {
        Verdict::Passed => Ok(()),
        verdict => Err(format!("{test}: {verdict:?} without a mistake")),
    }
}

/// Checks all on all processors; what is wrong.
fn wrong<T: Send>(all: impl IntoIterator<Item = T>, check: fn(T) -> Result<(), String>) -> Vec<String> {
    let left = Mutex::new(all.into_iter().collect::<Vec<T>>());
    let next = || left.lock().expect("no thread panics with it").pop();
    let run = || std::iter::from_fn(next).filter_map(|one| check(one).err()).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..threads).map(|_| scope.spawn(|| -> Vec<String> { run() })).collect();
        all.into_iter().flat_map(|thread| thread.join().expect("it does not panic")).collect()
    })
}

fn planted() -> impl Iterator<Item = &'static Planted> {
    GROUPS.iter().flat_map(|group| group.mistakes).filter(|planted| planted.shows_in != IN_NETWORKS)
}

#[test]
fn each_mistake_is_noticed_by_the_test_that_is_named_for_it() {
    let unnoticed = wrong(planted(), notices);
    assert!(unnoticed.is_empty(), "{}", unnoticed.join("\n"));
}

#[test]
fn each_of_these_tests_passes_without_a_mistake() {
    let tests: BTreeSet<&str> = planted().map(|planted| planted.shows_in).collect();
    let failed = wrong(tests, passes);
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn a_test_that_notices_nothing_is_told() {
    let told = |shows_in| notices(&Planted { name: "SkipsCheck", text: "", shows_in, edits: &[] }).unwrap_err();
    assert!(told("tdma::tests::arithmetic::moments_have_owners").contains("Passed with SkipsCheck"));
    assert!(told("no_such_test").contains("Unknown"));
    assert!(passes("no_such_test").is_err());
}
