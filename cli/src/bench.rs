//! `rohrpost bench local`: how fast this computer passes packages between processes, next to its hardware floor.

use crate::terminal::{Failure, complain, say};
use rohrpost_bench_local::environment::Environment;
use rohrpost_bench_local::harness::Scheduling;
use rohrpost_bench_local::report::{self, Report};
use rohrpost_bench_local::rounds::Row;
use rohrpost_bench_local::{Settings, latency};
use rohrpost_mailbox::{Node, base_directory};
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

/// Rounds of the self-test; it takes about five seconds.
const ROUNDS: usize = 3;

/// Our median may exceed the floor by this factor; beyond it something is strange. The target is 1.1.
const STRANGE_BLOCKING: f64 = 1.5;

/// Spinning pays if it is faster than sleeping by this factor; mostly it is ten times faster or more. The ratio to bare
/// spinning says more about the path between two processors than about the computer as a whole.
const SPINNING_PAYS: f64 = 2.0;

/// If the p99 of the futex floor is longer than this, the computer does not wake threads in time, µs.
const LATE_US: f64 = 100.0;

/// The page with more explanation.
const TUNING: &str = "docs/src/tuning.md";

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost bench local")]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Mailboxes between two processes, next to bare shared memory; takes 5 seconds.
    #[command(
        after_help = "Example: rohrpost bench local\nIt keeps two processors busy: do not run it while a robot works. \
            If a node is launched, it\nmeasures with the default scheduler and delays no module."
    )]
    Local(Local),
}

#[derive(clap::Args)]
struct Local {
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let What::Local(arguments) = &arguments.what;
    let launched = launched();
    let scheduling = if launched.is_empty() { Scheduling::Fifo } else { Scheduling::Normal };
    for node in &launched {
        complain(format_args!(
            "warning: {} is launched on this computer, and this takes two processors for some seconds: measuring with \
             the default scheduler, so that real-time modules keep theirs; the figures are worse for it",
            node.display()
        ));
    }
    let settings = Settings { rounds: ROUNDS, ..Settings::default() };
    let report = report::run(&settings, &latency::self_test(scheduling), arguments.json, say)?;
    if !arguments.json {
        say(format!("\n{}", meaning(&report, scheduling, &Hints::look())));
    }
    Ok(if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn launched() -> Vec<PathBuf> {
    let entries = fs::read_dir(base_directory()).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    paths.filter(|path| Node::open(path).is_ok_and(|node| node.launcher().is_some())).collect()
}

/// Known causes of latency on this computer.
struct Hints {
    /// Governor of the first processor; none where it cannot be chosen.
    governor: Option<String>,
    is_virtual: bool,
    /// This program was compiled for development.
    is_slow_build: bool,
}

impl Hints {
    fn look() -> Self {
        let governor = fs::read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").ok();
        let processor = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let mut flags = processor.lines().filter(|line| line.starts_with("flags"));
        Self {
            governor: governor.map(|name| name.trim().to_string()),
            is_virtual: flags.any(|line| line.split_whitespace().any(|flag| flag == "hypervisor")),
            is_slow_build: cfg!(debug_assertions),
        }
    }
}

/// Our row next to a floor, for small messages.
fn small<'a>(rows: &'a [Row], floor: &str) -> Option<&'a Row> {
    rows.iter().find(|row| row.bytes == Some(64) && row.versus.is_some_and(|versus| versus.name == floor))
}

/// What the figures mean, and where to look if they are bad.
fn meaning(report: &Report, scheduling: Scheduling, hints: &Hints) -> String {
    let (Some(blocking), Some(spinning)) = (small(&report.rows, "futex"), small(&report.rows, "spin")) else {
        return "NOTHING TO SAY: no figures.".into();
    };
    let figures = (&blocking.result, blocking.ratio_p50, &spinning.result, spinning.ratio_p50);
    let (Ok(asleep), Some(ratio_asleep), Ok(awake), Some(ratio_awake)) = figures else {
        return "NO ANSWER: a part of the test did not run; the notes under the tables say why.".into();
    };
    let said = format!(
        "a package of 64 B takes {:.1} µs to a module that sleeps, {:.1} times what the computer takes to wake any \
         process, and {:.2} µs to one that spins, {:.1} times bare shared memory",
        asleep.p50, ratio_asleep.median, awake.p50, ratio_awake.median
    );
    let floor = report.rows.iter().find(|row| row.contender == "futex").and_then(|row| row.result.as_ref().ok()?.p99);
    let is_late = floor.is_some_and(|p99| p99 > LATE_US);
    let is_strange = ratio_asleep.median > STRANGE_BLOCKING || awake.p50 * SPINNING_PAYS > asleep.p50;
    if !is_late && !is_strange && report.environment.refusals.is_empty() && scheduling == Scheduling::Fifo {
        return format!("GOOD: {said}.");
    }
    let look = look_at(&report.environment, scheduling, hints);
    let advice = if look.is_empty() { "other busy programs".to_string() } else { look.join("; ") };
    let late =
        floor.filter(|_| is_late).map(|p99| format!("; a bare wake-up is late by {p99:.0} µs once in a hundred times"));
    format!("LOOK: {said}{}. What to look at: {advice}. See {TUNING}.", late.unwrap_or_default())
}

/// Known causes of latency here, as text.
fn look_at(environment: &Environment, scheduling: Scheduling, hints: &Hints) -> Vec<String> {
    let refused = (!environment.refusals.is_empty()).then(|| {
        format!("the kernel refuses real time ({}), give the user the right", environment.refusals.join("; "))
    });
    let robot = (scheduling == Scheduling::Normal).then(|| "a node is launched: measure again without it".to_string());
    let slow = hints.governor.as_ref().filter(|governor| *governor != "performance");
    let governor = slow.map(|name| format!("the CPU governor is `{name}`, `performance` wakes sooner"));
    let host = hints.is_virtual.then(|| "this is a virtual machine: its host decides when it runs".to_string());
    let build =
        hints.is_slow_build.then(|| "this `rohrpost` is a development build, `--release` is faster".to_string());
    [refused, robot, governor, host, build].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_bench_local::rounds::Versus;
    use rohrpost_bench_local::statistics::{Ratio, Summary};

    fn row(floor: &'static str, contender: &'static str, ratio: f64, p99: f64) -> Row {
        let p50 = if floor == "spin" { 0.5 } else { 8.0 };
        let median = Ratio { median: ratio, min: ratio, max: ratio };
        let result = Ok(Summary { p50, p99: Some(p99), p999: Some(p99), max: Some(p99) });
        let versus = (contender == "rohrpost").then_some(Versus { name: floor, p50: None, p99: None });
        let (case, unit) = (floor.to_string(), "us");
        Row { case, bytes: Some(64), contender, unit, result, versus, ratio_p50: Some(median), ratio_p99: None }
    }

    fn environment(refusals: &[&str]) -> Environment {
        let [processor, kernel, load] = [const { String::new() }; 3];
        let refusals = refusals.iter().map(ToString::to_string).collect();
        Environment { processor, processors: vec![0, 1], kernel, load, refusals, versions: Vec::new() }
    }

    fn said(ratio: f64, p99: f64, refusals: &[&str], scheduling: Scheduling) -> String {
        let rows = vec![
            row("futex", "rohrpost", ratio, p99),
            row("futex", "futex", 1.0, p99),
            row("spin", "rohrpost", ratio, p99),
            row("spin", "spin", 1.0, p99),
        ];
        let environment = environment(refusals);
        let hints = Hints { governor: Some("powersave".into()), is_virtual: true, is_slow_build: false };
        meaning(&Report { environment, rows }, scheduling, &hints)
    }

    #[test]
    fn the_verdict_names_the_causes_of_bad_figures() {
        let good = said(1.1, 20.0, &[], Scheduling::Fifo);
        assert!(good.starts_with("GOOD: a package of 64 B takes 8.0 µs") && !good.contains("powersave"), "{good}");
        for (text, part) in [
            (said(1.1, 20.0, &["SCHED_FIFO: EPERM"], Scheduling::Fifo), "refuses real time (SCHED_FIFO: EPERM)"),
            (said(1.1, 20.0, &[], Scheduling::Normal), "a node is launched"),
            (said(9.0, 20.0, &[], Scheduling::Fifo), "`powersave`"),
            (said(1.1, 500.0, &[], Scheduling::Fifo), "late by 500 µs"),
        ] {
            assert!(text.starts_with("LOOK: ") && text.contains(part) && text.ends_with("tuning.md."), "{text}");
        }
    }

    #[test]
    fn missing_figures_give_no_verdict() {
        let mut report = Report { environment: environment(&[]), rows: Vec::new() };
        let hints = Hints { governor: None, is_virtual: false, is_slow_build: true };
        assert!(meaning(&report, Scheduling::Fifo, &hints).starts_with("NOTHING"));
        report.rows = vec![row("futex", "rohrpost", 1.0, 1.0), row("spin", "rohrpost", 1.0, 1.0)];
        report.rows[0].result = Err(rohrpost_bench_local::Failure::Skipped("no second processor".into()));
        assert!(meaning(&report, Scheduling::Fifo, &hints).starts_with("NO ANSWER"));
    }
}
