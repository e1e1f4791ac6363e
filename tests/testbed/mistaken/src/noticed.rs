//! The routers' own tests notice the mistakes: each in a process of its own that makes one mistake all the time.

use crate::catalog::GROUPS;
use crate::catalog::planted::Planted;
use crate::mistakes::MISTAKE_VARIABLE;
use std::process::{Command, Stdio};
use std::sync::Mutex;

/// Runs one of the copied tests, which are ignored otherwise, with a mistake.
fn fails(planted: &Planted) -> Result<(), String> {
    let test = planted.shows_in;
    let mut command = Command::new(std::env::current_exe().expect("a test has a file"));
    command.args(["--exact", test, "--ignored", "--test-threads=1"]).env(MISTAKE_VARIABLE, planted.name);
    let output = command.stdin(Stdio::null()).output().expect("a test can be run");
    let text = String::from_utf8_lossy(&output.stdout);
    if text.contains("test result: FAILED. 0 passed; 1 failed;") {
        return Ok(());
    }
    let why = if text.contains(" 1 passed;") { "notices nothing of" } else { "is not there, or could not run, for" };
    Err(format!("{test} {why} {}: {}", planted.name, planted.text))
}

#[test]
fn each_mistake_is_noticed_by_the_test_that_is_named_for_it() {
    let planted = GROUPS.iter().flat_map(|group| group.mistakes);
    let left = Mutex::new(planted);
    let next = || left.lock().expect("no thread panics with it").next();
    let run = || std::iter::from_fn(next).filter_map(|planted| fails(planted).err()).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let unnoticed: Vec<String> = std::thread::scope(|scope| {
        let all: Vec<_> = (0..threads).map(|_| scope.spawn(|| -> Vec<String> { run() })).collect();
        all.into_iter().flat_map(|thread| thread.join().expect("it does not panic")).collect()
    });
    assert!(unnoticed.is_empty(), "{}", unnoticed.join("\n"));
}

#[test]
fn a_test_that_notices_nothing_is_told() {
    let told = |shows_in| fails(&Planted { name: "SkipsCheck", text: "", shows_in, edits: &[] }).unwrap_err();
    assert!(told("tdma::tests::arithmetic::moments_have_owners").contains("notices nothing"));
    assert!(told("no_such_test").contains("is not there"));
}
