//! A case: what is measured.

use crate::harness::Failure;
use crate::rounds::{Row, Subject};
use crate::settings::Settings;

/// One measurement: its contenders, what they are compared with, and the targets.
pub struct Case {
    subject: Subject,
    measure: Box<Measure>,
}

type Measure = dyn Fn(&Settings, &Subject) -> Result<Vec<Row>, Failure>;

impl Case {
    /// A case with this name in `--only` and in the table. `measure` gives its rows: a contender that fails or is
    /// skipped has one that says so; `Err` is an error of the whole case.
    pub fn new(
        name: impl Into<String>,
        bytes: impl Into<Option<usize>>,
        unit: &'static str,
        measure: impl Fn(&Settings, &Subject) -> Result<Vec<Row>, Failure> + 'static,
    ) -> Self {
        let subject = Subject { case: name.into(), bytes: bytes.into(), unit };
        Self { subject, measure: Box::new(measure) }
    }

    /// Name in `--only` and in the table.
    pub fn name(&self) -> &str {
        &self.subject.case
    }

    /// Measures.
    ///
    /// # Errors
    /// When the case cannot start.
    pub fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        (self.measure)(settings, &self.subject)
    }
}
