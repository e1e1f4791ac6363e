//! A case: what is measured, and how it fails.

use crate::harness::Failure;
use crate::rounds::Row;
use crate::settings::Settings;

/// What goes wrong in a turn that does many different things.
pub(super) type Done<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// As a turn has to say it. What was skipped remains so.
pub(super) fn as_failure(what: &str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> Failure {
    move |error| match error.downcast::<Failure>() {
        Ok(failure) => *failure,
        Err(error) => Failure::of(what, error),
    }
}

/// Something that is measured, against whom, and with which target.
pub trait Case {
    /// As `--only` and the table call it.
    fn name(&self) -> String;

    /// Measures. A contender that fails or is skipped is a row that says so; `Err` is for what hits the whole case.
    ///
    /// # Errors
    /// When the case cannot be begun.
    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure>;
}
