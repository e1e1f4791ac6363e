//! Stages of a check. Each runs, even if one before it failed, so one run shows all failures; a table of what they cost
//! comes last.

use crate::failure::Failure;
use crate::parts::{Part, Spent, of_ended_children};
use crate::report;
use std::fmt::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A part of a check.
pub(crate) struct Stage {
    /// Its row in the table.
    pub(crate) name: &'static str,
    /// Seconds of processor time that it needs on the slowest machine that it is to pass on, with nothing built yet.
    pub(crate) budget_s: u64,
    pub(crate) run: fn() -> Done,
}

/// How a stage ended, and what its parts cost.
pub(crate) type Done = (Vec<Part>, Result<(), Failure>);

/// What came of a stage.
struct Outcome {
    name: &'static str,
    budget_s: u64,
    took: Spent,
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
        budget_s: 1,
        took: Spent::default(),
        parts: Vec::new(),
        result: begun.and(allowed),
    });
    eprint!("{}{text}", table(&outcomes));
    if outcomes.iter().all(|outcome| outcome.result.is_ok()) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn outcome(stage: Stage) -> Outcome {
    let (began, before) = (Instant::now(), of_ended_children());
    let (parts, result) = (stage.run)();
    let took = Spent { wall: began.elapsed(), processor: of_ended_children() - before };
    let result = result.and_then(|()| within(&stage, took.processor));
    if let Err(failure) = &result {
        eprintln!("xtask: {failure}");
    }
    Outcome { name: stage.name, budget_s: stage.budget_s, took, parts, result }
}

/// A stage fails at one and a half of its budget. Either what made it dearer is a mistake, or it is worth it; then the
/// budget is raised, with the reason in the commit.
fn within(stage: &Stage, processor: Duration) -> Result<(), Failure> {
    let Stage { name, budget_s, .. } = stage;
    let took_s = processor.as_secs();
    if 2 * took_s <= 3 * budget_s {
        return Ok(());
    }
    Err(format!("{name}: {took_s} s of processor time, more than 1.5 times its budget of {budget_s} s"))
}

/// The result, then a row for each stage and its parts, then what failed.
fn table(outcomes: &[Outcome]) -> String {
    let failed = outcomes.iter().filter(|outcome| outcome.result.is_err()).count();
    let took: Spent = outcomes.iter().map(|outcome| outcome.took).sum();
    let (wall, processor_s) = (minutes(took.wall), took.processor.as_secs());
    let mut text = match failed {
        0 => format!("==> all {} stages passed in {wall}, with {processor_s} s of processor time\n", outcomes.len()),
        _ => {
            format!("==> {failed} of {} stages failed, in {wall}, {processor_s} s of processor time\n", outcomes.len())
        }
    };
    writeln!(text, "    {:<48} {:>6} {:>11} {:>8}", "", "time", "processor s", "budget s").expect("a String takes all");
    let mut row = |name: &str, took: &Spent, words: &str| {
        let (wall, processor_s) = (minutes(took.wall), took.processor.as_secs());
        writeln!(text, "    {name:<48} {wall:>6} {processor_s:>11} {words}").expect("a String takes all");
    };
    for Outcome { name, budget_s, took, parts, result } in outcomes {
        let word = if result.is_ok() { "ok" } else { "FAILED" };
        row(name, took, &format!("{budget_s:>8}  {word}"));
        parts.iter().for_each(|part| row(&format!("    {}", part.name), &part.took, ""));
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
        let spent = |seconds| Spent { wall: Duration::from_secs(seconds), processor: Duration::from_secs(2 * seconds) };
        let part = Part { name: "build".to_owned(), took: spent(seconds / 2) };
        Outcome { name, budget_s: 600, took: spent(seconds), parts: vec![part], result }
    }

    #[test]
    fn the_table_begins_with_the_result_and_names_what_failed_and_what_it_cost() {
        let mut outcomes = vec![ended("format", 3, Ok(())), ended("tests", 777, Err("tests: exit 1".to_owned()))];
        let told = table(&outcomes);
        assert!(told.starts_with("==> 1 of 2 stages failed, in 13:00, 1560 s of processor time\n"), "{told}");
        assert!(told.contains("12:57        1554      600  FAILED\n"), "{told}");
        assert!(told.contains("        build") && told.ends_with("    tests: exit 1\n"), "{told}");
        outcomes.pop();
        let told = table(&outcomes);
        assert!(told.starts_with("==> all 1 stages passed in 0:03, with 6 s of processor time\n"), "{told}");
    }

    #[test]
    fn a_stage_that_fails_is_an_outcome_like_others() {
        let fails = Stage { name: "fails", budget_s: 1, run: || (Vec::new(), Err("on purpose".into())) };
        let outcomes = [fails, Stage { name: "passes", budget_s: 1, run: || (Vec::new(), Ok(())) }].map(outcome);
        assert_eq!(outcomes.map(|outcome| outcome.result), [Err("on purpose".into()), Ok(())]);
    }

    #[test]
    fn a_stage_fails_beyond_one_and_a_half_of_its_budget() {
        let stage = Stage { name: "tests", budget_s: 100, run: || (Vec::new(), Ok(())) };
        assert_eq!(within(&stage, Duration::from_secs(150)), Ok(()));
        let refused = within(&stage, Duration::from_secs(151)).unwrap_err();
        assert_eq!(refused, "tests: 151 s of processor time, more than 1.5 times its budget of 100 s");
    }
}
