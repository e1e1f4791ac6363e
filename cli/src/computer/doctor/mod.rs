//! `rohrpost doctor`: checks whether this computer can run a robot in time, and names the fixes.

mod finding;
mod kernel;
mod lan;
mod machine;
mod measure;
mod network;
mod place;
mod protection;
mod rights;
mod security;
mod standby;
mod supervision;

use crate::terminal::{Failure, say, say_folded};
use finding::{Finding, Grade};
pub(crate) use machine::room_of_nodes;
use machine::{Machine, Needs};
use protection::Protection;
use rohrpost_launch::choose_node;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost doctor                            the state of this computer
  rohrpost doctor --config robot.toml        also whether it suffices for this configuration
  rohrpost doctor --measure                  also how late a thread wakes up, in one second
Exit code 1: something is bad. Changes nothing.")]
pub(crate) struct Arguments {
    /// Configuration that will run here.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Node of the configuration, if it has several.
    #[arg(long, value_name = "NAME", requires = "config")]
    node: Option<String>,
    /// Measure for one second how late a thread wakes up.
    #[arg(long)]
    measure: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (mut needs, mut lan, mut protection) = (Needs::default(), None, Protection::default());
    if let Some(file) = &arguments.config {
        let installation = crate::begin::check::load(file)?;
        let node = choose_node(&installation, arguments.node.as_deref())?;
        needs = Needs::of(&installation, node);
        needs.supervisors = supervision::supervisors(&installation, node);
        needs.seats = standby::seats(&installation, node);
        lan = network::ask(&installation, node);
        protection = Protection::of(&installation, &node.name);
    }
    let mut findings = examine(&Machine::this(&needs, lan, protection), &needs);
    if arguments.measure {
        findings.push(measure::wake_up(needs.priority));
    }
    if arguments.json {
        say(json(&findings));
    } else {
        say_folded(page(&findings));
    }
    let bad = findings.iter().any(|finding| finding.state == Grade::Bad);
    Ok(if bad { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn examine(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let mut findings = kernel::findings(machine);
    findings.extend(rights::findings(machine, needs));
    findings.extend(place::findings(machine, needs));
    findings.extend(supervision::findings(machine, needs));
    findings.extend(standby::findings(needs));
    findings.extend(security::findings(machine, needs));
    findings.extend(network::findings(machine, needs));
    findings
}

/// The column at which a finding's text begins.
const INDENT: usize = 24;

fn page(findings: &[Finding]) -> String {
    let mut text = String::new();
    for Finding { what, state, is, why, fix } in findings {
        text += &format!("{:4}  {what:<width$}{is}\n", state.name(), width = INDENT - 6);
        text += &format!("{:INDENT$}{why}\n", "");
        if let Some(fix) = fix {
            text += &format!("{:INDENT$}fix: {fix}\n", "");
        }
    }
    let count = |state| findings.iter().filter(|finding| finding.state == state).count();
    text + &format!("\n{} ok, {} warnings, {} bad", count(Grade::Ok), count(Grade::Warn), count(Grade::Bad))
}

fn json(findings: &[Finding]) -> serde_json::Value {
    let worst = findings.iter().map(|finding| finding.state).max().unwrap_or(Grade::Ok);
    serde_json::json!({ "state": worst, "findings": findings })
}

#[cfg(test)]
mod tests;
