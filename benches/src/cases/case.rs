//! A case: what is measured, and how it fails.

use crate::harness::Failure;
use crate::rounds::Row;
use crate::settings::Settings;

/// Errors in a turn that does several kinds of work.
pub(super) type Done<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// The error as a turn reports it. What was skipped stays skipped.
pub(super) fn as_failure(what: &str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> Failure {
    move |error| match error.downcast::<Failure>() {
        Ok(failure) => *failure,
        Err(error) => Failure::of(what, error),
    }
}

/// One measurement: its contenders, what they are compared with, and the targets.
pub trait Case {
    /// Name in `--only` and in the table.
    fn name(&self) -> String;

    /// Measures. A contender that fails or is skipped gives a row that says so; `Err` is an error of the whole case.
    ///
    /// # Errors
    /// When the case cannot start.
    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure>;
}
