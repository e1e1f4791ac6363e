//! Processes that make one mistake, and what their tests say of it.

use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Names the mistake that all threads of a process make from the beginning.
pub const MISTAKE_VARIABLE: &str = "ROHRPOST_MISTAKE";

/// Proptest's variable for where its random cases begin. Here they are the same in each run: a mistake that these cases
/// notice is noticed always. The sources' own tests search on with new cases.
const CASES: (&str, &str) = ("PROPTEST_RNG_SEED", "1");

/// The mistake that this process makes.
pub fn made() -> Option<&'static str> {
    static MADE: OnceLock<Option<String>> = OnceLock::new();
    MADE.get_or_init(|| std::env::var(MISTAKE_VARIABLE).ok()).as_deref()
}

/// Whether this process makes this mistake.
pub fn is_made(mistake: &str) -> bool {
    made() == Some(mistake)
}

/// What came of one copied test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// Whatever mistake was made, it does not show there.
    Passed,
    /// The mistake shows.
    Failed,
    /// The test is not there, or could not run.
    Unknown,
}

/// A run of copied tests.
pub struct Ran {
    /// Whether all that ran have passed.
    pub passed: bool,
    /// All that they wrote.
    pub text: String,
}

impl Ran {
    /// What came of the only test that was asked for.
    pub fn verdict(&self) -> Verdict {
        match self.text.lines().find_map(|line| line.strip_prefix("test result: ")) {
            Some(result) if result.starts_with("ok. 1 passed; 0 failed;") => Verdict::Passed,
            Some(result) if result.starts_with("FAILED. 0 passed; 1 failed;") => Verdict::Failed,
            _ => Verdict::Unknown,
        }
    }
}

/// Runs tests of this program that are ignored otherwise, with these arguments of the harness, in a process that makes
/// this mistake, or none.
///
/// # Panics
/// If this program cannot be started again.
pub fn run(arguments: &[&str], mistake: Option<&str>) -> Ran {
    let mut command = Command::new(std::env::current_exe().expect("a test has a file"));
    command.arg("--ignored").args(arguments).env_remove(MISTAKE_VARIABLE).env(CASES.0, CASES.1);
    mistake.map(|name| command.env(MISTAKE_VARIABLE, name));
    let output = command.stdin(Stdio::null()).output().expect("a test can be run");
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    Ran { passed: output.status.success(), text }
}
