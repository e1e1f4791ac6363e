//! Stages of a check. Each runs, even if one before it failed, so one run shows all failures; a table of them comes
//! last.

use crate::failure::Failure;
use std::fmt::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A part of a check.
pub(crate) struct Stage {
    /// Its row in the table.
    pub(crate) name: &'static str,
    pub(crate) run: fn() -> Result<(), Failure>,
}

/// What came of a stage.
struct Outcome {
    name: &'static str,
    took: Duration,
    result: Result<(), Failure>,
}

/// Runs all stages and prints the table.
pub(crate) fn run_all(stages: impl IntoIterator<Item = Stage>) -> ExitCode {
    let run = |stage: Stage| {
        let began = Instant::now();
        let result = (stage.run)();
        if let Err(failure) = &result {
            eprintln!("xtask: {failure}");
        }
        Outcome { name: stage.name, took: began.elapsed(), result }
    };
    let outcomes: Vec<Outcome> = stages.into_iter().map(run).collect();
    eprint!("{}", table(&outcomes));
    if outcomes.iter().all(|outcome| outcome.result.is_ok()) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The result, then a row for each stage, then what failed.
fn table(outcomes: &[Outcome]) -> String {
    let failed = outcomes.iter().filter(|outcome| outcome.result.is_err()).count();
    let took = outcomes.iter().map(|outcome| outcome.took).sum();
    let mut text = match failed {
        0 => format!("==> all {} stages passed in {}\n", outcomes.len(), minutes(took)),
        _ => format!("==> {failed} of {} stages failed, in {}\n", outcomes.len(), minutes(took)),
    };
    for Outcome { name, took, result } in outcomes {
        let word = if result.is_ok() { "ok" } else { "FAILED" };
        writeln!(text, "    {name:<48} {:>6}  {word}", minutes(*took)).expect("a String takes all");
    }
    for failure in outcomes.iter().filter_map(|outcome| outcome.result.as_ref().err()) {
        writeln!(text, "    {failure}").expect("a String takes all");
    }
    text
}

/// Minutes and seconds.
fn minutes(took: Duration) -> String {
    format!("{}:{:02}", took.as_secs() / 60, took.as_secs() % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_begins_with_the_result_and_names_what_failed() {
        let outcome = |name, seconds, result| Outcome { name, took: Duration::from_secs(seconds), result };
        let mut outcomes = vec![outcome("format", 3, Ok(())), outcome("tests", 777, Err("tests: exit 1".to_owned()))];
        let told = table(&outcomes);
        assert!(told.starts_with("==> 1 of 2 stages failed, in 13:00\n"), "{told}");
        assert!(told.contains("tests") && told.contains("12:57  FAILED") && told.ends_with("    tests: exit 1\n"));
        outcomes.pop();
        assert!(table(&outcomes).starts_with("==> all 1 stages passed in 0:03\n"));
    }

    #[test]
    fn a_stage_runs_although_one_before_it_failed() {
        use std::sync::atomic::{AtomicU32, Ordering};
        static RUNS: AtomicU32 = AtomicU32::new(0);
        fn fails() -> Result<(), Failure> {
            RUNS.fetch_add(1, Ordering::Relaxed);
            Err("it fails".into())
        }
        let stages = [Stage { name: "first", run: fails }, Stage { name: "second", run: fails }];
        assert_eq!(run_all(stages), ExitCode::FAILURE);
        assert_eq!(RUNS.load(Ordering::Relaxed), 2);
    }
}
