//! How much is measured.

use crate::harness::{Failure, OrFail};
use std::path::PathBuf;

/// How much a run measures. All cases obey it.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Rounds; in each, every contender of a case has its turn.
    pub rounds: usize,
    /// Only cases with a name that contains one of these; all if empty.
    pub only: Vec<String>,
    /// A few hundred messages a turn: shows that everything runs, and measures little.
    pub quick: bool,
    /// The `rohrpost` command to measure; none: the one beside this program.
    pub rohrpost: Option<PathBuf>,
    /// The interpreter for programs in Python; none: the system's.
    pub python: Option<PathBuf>,
    /// Versions of what is measured, for the head.
    pub versions: Vec<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { rounds: 7, only: Vec::new(), quick: false, rohrpost: None, python: None, versions: Vec::new() }
    }
}

impl Settings {
    /// Whether a case was asked for.
    pub fn wants(&self, case: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|part| case.contains(part.as_str()))
    }

    /// How many of something a turn does: `full`, or far fewer in a quick run.
    pub fn count(&self, full: usize) -> usize {
        if self.quick { full.min(300) } else { full }
    }

    /// The `rohrpost` command: the one that was named, or the one beside this program.
    ///
    /// # Errors
    /// [`Failure::Skipped`] when there is none.
    pub fn command(&self) -> Result<PathBuf, Failure> {
        let own = std::env::current_exe().or_fail("this program")?;
        let path = self.rohrpost.clone().unwrap_or(own.with_file_name("rohrpost"));
        if path.is_file() {
            return Ok(path);
        }
        Err(Failure::Skipped(format!("no {}; build it, or name it with --rohrpost", path.display())))
    }
}
