//! Mistakes in a configuration file: all of them at once, each with its line and its remedy.

use crate::sources::Origins;
use std::fmt;
use std::path::{Path, PathBuf};

/// One mistake in a configuration file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Line in the text, counted from 1: that of the file, or of what it resolved to; none if the file could not be
    /// read at all.
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
    origins: Origins,
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
        Self { path: path.to_owned(), problems, origins: Origins::default() }
    }

    /// With lines of a resolved text, which come from other files.
    pub(crate) fn with_origins(self, origins: &Origins) -> Self {
        Self { origins: origins.clone(), ..self }
    }

    /// The problems, each with the file and line that it stands in.
    pub fn placed(&self) -> impl Iterator<Item = (PathBuf, Option<usize>, String)> {
        self.problems.iter().map(|problem| {
            let place = problem.line.map(|line| self.origins.place(&self.path, line));
            let (file, line) = place.map_or((self.path.clone(), None), |(file, line)| (file, Some(line)));
            (file, line, self.origins.told(&self.path, &problem.message))
        })
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
        for (index, (file, line, message)) in self.placed().enumerate() {
            let (end_of_last, file) = (if index == 0 { "" } else { "\n" }, escaped(&file.display().to_string()));
            match line {
                Some(line) => write!(f, "{end_of_last}{file}:{line}: {message}")?,
                None => write!(f, "{end_of_last}{file}: {message}")?,
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
    /// The file that has the setting.
    pub path: PathBuf,
    /// Line of the setting in question, in that file.
    pub line: usize,
    /// The line in the text that it resolved to, as a [`Problem`] has it.
    pub text_line: usize,
    /// The module.
    pub module: String,
    /// What is wrong, in the words of the type.
    pub message: String,
}
