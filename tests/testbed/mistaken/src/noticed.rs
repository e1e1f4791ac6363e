//! The routers' own tests notice the mistakes: each in a process of its own that makes one mistake all the time. In the
//! copy without a mistake they pass, so a mistake it is that they notice.

use crate::catalog;
use crate::catalog::planted::{IN_NETWORKS, Planted};
use rohrpost_planted::{Verdict, run};
use std::collections::BTreeSet;
use std::sync::Mutex;

/// What comes of one of the copied tests.
fn verdict(test: &str, mistake: Option<&str>) -> Verdict {
    run(&["--exact", test, "--test-threads=1"], mistake).verdict()
}

fn notices(planted: &Planted) -> Result<(), String> {
    match verdict(planted.shows_in, Some(planted.name)) {
        Verdict::Failed => Ok(()),
        verdict => Err(format!("{}: {verdict:?} with {}: {}", planted.shows_in, planted.name, planted.text)),
    }
}

fn passes(test: &str) -> Result<(), String> {
    match verdict(test, None) {
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
    catalog::all().filter(|planted| planted.shows_in != IN_NETWORKS)
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
