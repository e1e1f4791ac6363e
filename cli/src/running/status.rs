//! `rohrpost status`.

use crate::look::control::{STATE, control_table, supervisor};
use crate::look::observer::Silence;
use crate::look::summary::Account;
use crate::look::target::{Inquiry, Running};
use crate::terminal::table::{table_of, time};
use crate::terminal::{Failure, say};
use rohrpost::common::{OutputLevel, Refused, Status};
use rohrpost::interfaces::{ControlState, SupervisorInterface};
use rohrpost::output::plain;
use rohrpost::wire::from_bytes;
use rohrpost::{Name, ToolLink};
use rohrpost_config::{Watchdog, duration_text};
use rohrpost_launch::survey::{ModuleSurvey, Scope, Standing};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost status mapper.0\nExit code 1: a module does not answer or is in error.")]
pub(crate) struct Arguments {
    /// Module to ask; all, if none is named.
    name: Option<String>,
    #[command(flatten)]
    inquiry: Inquiry,
}

#[derive(Serialize)]
struct StatusRow {
    module: String,
    node: String,
    #[serde(flatten)]
    account: Account,
    #[serde(flatten)]
    figures: Option<Figures>,
    /// Of a supervisor: how it stands with the motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    control: Option<ControlState>,
    /// The limit of a turn, if launch ends a module that is silent for longer.
    #[serde(skip)]
    watchdog: Option<Watchdog>,
    /// Why there is no report.
    failure: Option<String>,
}

/// A module's own report, in JSON as [`ModuleFigures`].
#[derive(Serialize)]
struct Figures(#[serde(with = "ModuleFigures")] Status);

/// What only the module itself knows.
#[derive(Serialize)]
#[serde(remote = "Status")]
struct ModuleFigures {
    incarnation: u32,
    uptime_ms: u64,
    subscribers: u32,
    missed: u64,
    lost: u64,
    output_lost: u64,
    output_suppressed: u64,
    output_level: Option<OutputLevel>,
    refused: Refused,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.inquiry.target.find()?;
    let (survey, silent) = running.survey(Scope::Modules)?;
    let named = arguments.name.as_deref().map(|name| running.module(name)).transpose()?;
    let is_meant = |module: &&ModuleSurvey| match named {
        Some(name) => module.names().any(|own| own == name.module()),
        None => !module.is_left_out(&running.installation),
    };
    let modules: Vec<&ModuleSurvey> = survey.modules.iter().filter(is_meant).collect();
    let mut tool = running.join(arguments.inquiry.timeout()?)?;
    let mut ask = |name, module| ask(&running, &mut tool, &silent, name, module);
    let lines: Vec<StatusRow> = match named.filter(|_| modules.is_empty()) {
        Some(unknown) => vec![ask(unknown, None)],
        None => modules.into_iter().map(|module| ask(named.unwrap_or(module.name), Some(module))).collect(),
    };
    if arguments.inquiry.json {
        say(serde_json::to_string(&lines)?);
    } else {
        say(print(&lines).trim_end());
    }
    let stands_by = |line: &StatusRow| line.account.state == Standing::StandsBy;
    let well = |line: &StatusRow| line.figures.is_some() && line.account.state != Standing::Error;
    let is_well = lines.iter().all(|line| stands_by(line) || well(line));
    Ok(if is_well { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A module's state: from launch, from its node's table, and from the module itself, unless it is known that it cannot
/// answer. `module`: what is known of it at one of its nodes.
fn ask(
    running: &Running,
    tool: &mut ToolLink,
    silent: &[Silence],
    name: Name,
    module: Option<&ModuleSurvey>,
) -> StatusRow {
    let account = module.map(|module| Account::of(module, &running.installation));
    let node = module.map_or_else(|| running.node_of(name).to_owned(), |module| module.node.clone());
    let watchdog = running.installation.module(name).and_then(|module| module.watchdog);
    let silence = silent.iter().find(|silence| silence.node == node).map(Silence::text);
    let row = |account, failure| StatusRow {
        module: running.text(name),
        node,
        account,
        figures: None,
        control: None,
        watchdog,
        failure,
    };
    let (failure, account) = match account {
        Some(account) if silence.is_none() && account.state == Standing::StandsBy => return row(account, None),
        Some(account) if silence.is_none() && !account.state.answers() => {
            let busy = account.error.clone().filter(|_| account.state == Standing::Busy);
            let failure = Some(busy.unwrap_or_else(|| running.absent(name).to_string()));
            return row(account, failure);
        }
        account => match silence.map_or_else(|| Ok(tool.status(name)), Err) {
            Ok(Ok(status)) => {
                let account = Account::said(&status, account);
                let control = supervisor(running, name).and_then(|name| control(tool, name));
                return StatusRow { figures: Some(Figures(status)), control, ..row(account, None) };
            }
            Ok(Err(error)) => (running.told(name, &error).to_string(), account),
            Err(silence) => (silence, account),
        },
    };
    row(Account::unreachable(&failure, account), Some(failure))
}

/// None from a supervisor that does not answer: its row says how it is.
fn control(tool: &mut ToolLink, supervisor: Name) -> Option<ControlState> {
    tool.call(supervisor, STATE, SupervisorInterface::hash(), |_| Ok(()), |bytes| from_bytes(bytes)).ok()
}

fn print(lines: &[StatusRow]) -> String {
    let mut heads = vec!["module", "state", ">up", ">restarts", ">subscribers", ">missed", ">lost", "last error"];
    let mut rows: Vec<Vec<String>> = lines.iter().map(cells).collect();
    // Columns only if they say something.
    if lines.iter().any(|line| line.watchdog.is_some()) {
        heads.insert(heads.len() - 1, ">in turn");
        rows.iter_mut().zip(lines).for_each(|(row, line)| row.insert(row.len() - 1, turn(line)));
    }
    if lines.iter().any(|line| line.node != lines[0].node) {
        heads.insert(1, "node");
        rows.iter_mut().zip(lines).for_each(|(row, line)| row.insert(1, line.node.clone()));
    }
    let modules = table_of(&heads, rows);
    let supervisors = lines.iter().filter_map(|line| Some((line.module.as_str(), line.control.as_ref()?)));
    if supervisors.clone().next().is_none() {
        return modules;
    }
    format!("{modules}\n{}", control_table(supervisors))
}

fn cells(line: &StatusRow) -> Vec<String> {
    let figure = |of: fn(&Status) -> String| line.figures.as_ref().map_or("-".into(), |figures| of(&figures.0));
    vec![
        line.module.clone(),
        line.account.state.to_string(),
        figure(|status| time(Duration::from_millis(status.uptime_ms))),
        line.account.restarts.to_string(),
        figure(|status| status.subscribers.to_string()),
        figure(|status| status.missed.to_string()),
        figure(|status| status.lost.to_string()),
        plain::line(line.account.error.as_deref().unwrap_or_default()).into_owned(),
    ]
}

/// For how long a module that is watched has been in a turn, of how long it may be.
fn turn(line: &StatusRow) -> String {
    let lasts = line.account.in_turn_s.map_or("-".into(), |turn_s| time(Duration::from_secs_f64(turn_s)));
    line.watchdog.map_or("-".into(), |watchdog| format!("{lasts} of {}", duration_text(watchdog.limit)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(module: &str, node: &str, state: Standing, limit_ms: Option<u64>, in_turn_s: Option<f64>) -> StatusRow {
        let mut account = Account::unreachable("", None);
        (account.state, account.error, account.in_turn_s) = (state, None, in_turn_s);
        let watchdog = |ms| Watchdog { limit: Duration::from_millis(ms), grace: Duration::ZERO };
        let (module, node, watchdog) = (module.into(), node.into(), limit_ms.map(watchdog));
        StatusRow { module, node, account, figures: None, control: None, watchdog, failure: None }
    }

    #[test]
    fn nodes_and_turns_have_columns_where_there_are_several_and_where_a_watchdog_looks() {
        let words = |rows: &[StatusRow]| {
            let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
            print(rows).lines().map(words).collect::<Vec<_>>()
        };
        let rows = [
            row("pilot.0", "brain", Standing::On, Some(300), Some(0.12)),
            row("pilot.0", "desk", Standing::StandsBy, Some(300), None),
            row("motor.0", "brain", Standing::On, None, Some(0.5)),
        ];
        assert_eq!(
            words(&rows),
            [
                "module node state up restarts subscribers missed lost in turn last error",
                "pilot.0 brain on - 0 - - - 120 ms of 300 ms",
                "pilot.0 desk standby - 0 - - - - of 300 ms",
                "motor.0 brain on - 0 - - - -",
            ]
        );
        assert_eq!(words(&rows[2..])[0], "module state up restarts subscribers missed lost last error");
    }
}
