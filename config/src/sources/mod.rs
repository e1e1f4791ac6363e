//! A configuration of several files, and variables of the environment, as one resolved text.
//!
//! ```text
//! robot.toml ─ include ─▶ common.toml        read: files, cycles
//!      │                      │
//!      └────── merge ◀────────┘              merge: tables by key, modules by name; conflicts
//!                │   ◀── environment         variables: `{ env = "PORT", or = "/dev/ttyUSB0" }`
//!                ▼
//!        resolved text                       origins: behind each value the file and line that it comes from
//! ```
//!
//! The resolved text is TOML like any other: recordings and journals keep it, and all else reads it as it reads a
//! single file. A file without `include` and variables is its own resolved text, to the byte.

mod merge;
mod origins;
mod read;
mod variables;

pub(crate) use origins::Origins;
use std::path::Path;

use crate::errors::Errors;

/// Reads a file with all that it includes, and the environment, as one text.
///
/// # Errors
/// A file that cannot be read or is no TOML, files that include each other in a circle, values that contradict each
/// other, and variables that cannot be used.
pub fn resolved_text(path: &Path) -> Result<String, Errors> {
    resolved_with(path, |name| std::env::var(name).ok())
}

/// As [`resolved_text`], with this environment.
pub(crate) fn resolved_with(path: &Path, variable: impl Fn(&str) -> Option<String>) -> Result<String, Errors> {
    let sources = read::Sources::read(path)?;
    if sources.is_alone() && !sources.tables().any(variables::is_any) {
        return Ok(sources.into_text());
    }
    let mut merged = sources.merged()?;
    variables::put_in(&mut merged, &sources, &variable)?;
    Ok(sources.text_of(&merged))
}

#[cfg(test)]
mod tests;
