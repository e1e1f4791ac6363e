//! Runs promises with and without a mistake.

use crate::catalog::MISTAKES;
use std::process::{Command, Output};
use std::sync::OnceLock;

const MISTAKE: &str = "ROHRPOST_MISTAKE";

/// Proptest's variable for where its random cases begin. Here they are the same in each run: a mistake that these cases
/// notice is noticed always. The crate's own tests search on with new cases.
const CASES: (&str, &str) = ("PROPTEST_RNG_SEED", "1");

/// Whether this process makes this mistake.
pub(crate) fn is_made(mistake: &str) -> bool {
    static MADE: OnceLock<Option<String>> = OnceLock::new();
    MADE.get_or_init(|| std::env::var(MISTAKE).ok()).as_deref() == Some(mistake)
}

fn promises(arguments: &[&str], mistake: &str) -> (Output, String) {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored"]).args(arguments).env(MISTAKE, mistake).env(CASES.0, CASES.1);
    let output = command.output().unwrap();
    let text = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text)).concat();
    (output, text)
}

pub(crate) fn is_noticed(name: &str) {
    let mistake = MISTAKES.iter().find(|mistake| mistake.name == name).unwrap();
    let (output, text) = promises(&["--exact", mistake.promise], name);
    assert!(text.contains("running 1 test"), "{}: there is no such test:\n{text}", mistake.promise);
    assert!(!output.status.success(), "{} does not notice {name}", mistake.promise);
}

#[test]
fn without_a_mistake_all_promises_are_kept() {
    let (output, text) = promises(&[], "");
    assert!(output.status.success() && !text.contains("running 0 tests"), "{text}");
}
