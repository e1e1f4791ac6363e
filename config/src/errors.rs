//! Mistakes in a configuration file: all of them at once, each with its line and its remedy.

use std::fmt;
use std::path::{Path, PathBuf};

/// One mistake in a configuration file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Line in the file, counted from 1; none if the file could not be read at all.
    pub line: Option<usize>,
    /// The mistake and its remedy.
    pub message: String,
}

/// Everything that is wrong with one configuration file, by line.
///
/// Printed, each problem is one line: `demo.toml:41: module ...`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Errors {
    path: PathBuf,
    problems: Vec<Problem>,
}

impl Errors {
    /// The problems of a file, in any order. A message that quotes the file shows its control characters as escapes, so
    /// that it stays one line and commands no terminal.
    pub fn new(path: &Path, mut problems: Vec<Problem>) -> Self {
        for problem in problems.iter_mut().filter(|problem| problem.message.contains(char::is_control)) {
            problem.message = escaped(&problem.message);
        }
        problems.sort_by_key(|problem| problem.line);
        problems.dedup();
        Self { path: path.to_owned(), problems }
    }

    /// The file, as it was named to [`Installation::load`](crate::Installation::load).
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The problems, sorted by line; never empty.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }
}

/// Control characters as a TOML file writes them.
fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if c.is_control() { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown
}

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            let end_of_last = if index == 0 { "" } else { "\n" };
            match problem.line {
                Some(line) => write!(f, "{end_of_last}{}:{line}: {}", self.path.display(), problem.message)?,
                None => write!(f, "{end_of_last}{}: {}", self.path.display(), problem.message)?,
            }
        }
        Ok(())
    }
}

impl std::error::Error for Errors {}

/// Settings that a module cannot use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}:{line}: settings of module `{module}`: {message}", path.display())]
pub struct SettingsError {
    /// The configuration file.
    pub path: PathBuf,
    /// Line of the setting in question.
    pub line: usize,
    /// The module.
    pub module: String,
    /// What is wrong, in the words of the type.
    pub message: String,
}
