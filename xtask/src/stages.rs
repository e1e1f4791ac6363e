//! Stages of a check. Each runs, even if one before it failed, so one run shows all failures; a table of them comes
//! last.

use crate::failure::Failure;
use crate::parts::Part;
use crate::report;
use std::fmt::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A part of a check.
pub(crate) struct Stage {
    /// Its row in the table.
    pub(crate) name: &'static str,
    /// Minutes that it may take on two processors with nothing else to do, if nothing is built yet.
    pub(crate) budget: u64,
    pub(crate) run: fn() -> Done,
}

/// How a stage ended, and how long its parts took.
pub(crate) type Done = (Vec<Part>, Result<(), Failure>);

/// What came of a stage.
struct Outcome {
    name: &'static str,
    budget: Duration,
    took: Duration,
    parts: Vec<Part>,
    result: Result<(), Failure>,
}

/// Runs all stages and prints the table, with what tests have skipped and repeated.
pub(crate) fn run_all(stages: impl IntoIterator<Item = Stage>) -> ExitCode {
    let begun = report::begin();
    let mut outcomes: Vec<Outcome> = stages.into_iter().map(outcome).collect();
    let (text, allowed) = report::end();
    outcomes.push(Outcome {
        name: "skipped and repeated tests are allowed",
        budget: Duration::MAX,
        took: Duration::ZERO,
        parts: Vec::new(),
        result: begun.and(allowed),
    });
    eprint!("{}{text}", table(&outcomes));
    if outcomes.iter().all(|outcome| outcome.result.is_ok()) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a stage.
fn outcome(stage: Stage) -> Outcome {
    let began = Instant::now();
    let (parts, result) = (stage.run)();
    if let Err(failure) = &result {
        eprintln!("xtask: {failure}");
    }
    let budget = Duration::from_secs(60 * stage.budget);
    Outcome { name: stage.name, budget, took: began.elapsed(), parts, result }
}

/// The result, then a row for each stage and its parts, then what failed.
fn table(outcomes: &[Outcome]) -> String {
    let failed = outcomes.iter().filter(|outcome| outcome.result.is_err()).count();
    let took = outcomes.iter().map(|outcome| outcome.took).sum();
    let mut text = match failed {
        0 => format!("==> all {} stages passed in {}\n", outcomes.len(), minutes(took)),
        _ => format!("==> {failed} of {} stages failed, in {}\n", outcomes.len(), minutes(took)),
    };
    let mut row = |name: &str, took: Duration, words: &str| {
        writeln!(text, "    {name:<48} {:>6}  {words}", minutes(took)).expect("a String takes all");
    };
    for Outcome { name, budget, took, parts, result } in outcomes {
        let word = if result.is_ok() { "ok" } else { "FAILED" };
        let over = if took > budget { format!(", over its budget of {}", minutes(*budget)) } else { String::new() };
        row(name, *took, &format!("{word}{over}"));
        parts.iter().for_each(|part| row(&format!("    {}", part.name), part.took, ""));
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

    fn ended(name: &'static str, seconds: u64, result: Result<(), Failure>) -> Outcome {
        let part = Part { name: "build".to_owned(), took: Duration::from_secs(seconds / 2) };
        let [budget, took] = [600, seconds].map(Duration::from_secs);
        Outcome { name, budget, took, parts: vec![part], result }
    }

    #[test]
    fn the_table_begins_with_the_result_and_names_what_failed_and_what_took_too_long() {
        let mut outcomes = vec![ended("format", 3, Ok(())), ended("tests", 777, Err("tests: exit 1".to_owned()))];
        let told = table(&outcomes);
        assert!(told.starts_with("==> 1 of 2 stages failed, in 13:00\n"), "{told}");
        assert!(told.contains("12:57  FAILED, over its budget of 10:00\n"), "{told}");
        assert!(told.contains("        build") && told.ends_with("    tests: exit 1\n"), "{told}");
        outcomes.pop();
        let told = table(&outcomes);
        assert!(told.starts_with("==> all 1 stages passed in 0:03\n") && !told.contains("budget"), "{told}");
    }

    #[test]
    fn a_stage_that_fails_is_an_outcome_like_others() {
        let fails = Stage { name: "fails", budget: 1, run: || (Vec::new(), Err("on purpose".into())) };
        let outcomes = [fails, Stage { name: "passes", budget: 1, run: || (Vec::new(), Ok(())) }].map(outcome);
        assert_eq!(outcomes.map(|outcome| outcome.result), [Err("on purpose".into()), Ok(())]);
    }
}
