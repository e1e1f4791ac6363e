//! A run: the computer, and the cases one after the other; each is reported as soon as it is measured.

use crate::case::Case;
use crate::environment::{self, Environment};
use crate::harness::{self, Failure};
use crate::rounds::Row;
use crate::settings::Settings;
use crate::table;

/// What a run found.
pub struct Report {
    /// The computer.
    pub environment: Environment,
    /// All rows of all cases.
    pub rows: Vec<Row>,
}

impl Report {
    /// Whether all contenders worked. A missed target is no failure.
    pub fn is_sound(&self) -> bool {
        !self.rows.iter().any(|row| matches!(row.result, Err(Failure::Failed(_))))
    }
}

/// Measures the cases that the settings select, and passes every line or table to `say`. If `say` returns false, the
/// run ends: nobody reads. Meanwhile terminating signals end only this run, and its files are removed.
///
/// The calling process must have no other thread.
///
/// # Errors
/// When a word of the settings names no case, when a case cannot be begun, or after a signal.
pub fn run(settings: &Settings, cases: &[Case], json: bool, say: impl Fn(String) -> bool) -> Result<Report, Failure> {
    check_names(&settings.only, cases)?;
    harness::heed();
    harness::sweep();
    let environment = Environment::look(&settings.versions)?;
    let mut report = Report { environment, rows: Vec::new() };
    let head = &report.environment;
    let mut is_read =
        say(if json { table::json_environment(head) } else { format!("{}\n", table::human_environment(head)) });
    for case in cases.iter().filter(|case| settings.wants(case.name())) {
        if !is_read {
            break;
        }
        let rows = case.run(settings)?;
        if harness::interrupted() {
            return Err(Failure::Failed("interrupted".into()));
        }
        is_read = if json { rows.iter().all(|row| say(table::json(row))) } else { say(table::human(&rows)) };
        report.rows.extend(rows);
    }
    let load = environment::load();
    say(if json { table::json_load_afterwards(&load) } else { format!("load afterwards  {load}") });
    Ok(report)
}

/// Each word that was asked for must be part of a case's name.
fn check_names(only: &[String], cases: &[Case]) -> Result<(), Failure> {
    let mut names: Vec<&str> = cases.iter().map(Case::name).collect();
    names.dedup();
    match only.iter().find(|word| !names.iter().any(|name| name.contains(word.as_str()))) {
        None => Ok(()),
        Some(word) => Err(Failure::Failed(format!("no case is called `{word}`; there are: {}", names.join("; ")))),
    }
}
