//! A case: what is measured.

use crate::harness::Failure;
use crate::rounds::Row;
use crate::settings::Settings;

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
