//! `rohrpost status`.

use crate::look::observer::Silence;
use crate::look::summary::Account;
use crate::look::target::{Running, Target};
use crate::terminal::table::{table, time};
use crate::terminal::{Failure, say};
use rohrpost::common::{OutputLevel, Refused, Status};
use rohrpost::output::plain;
use rohrpost::{Name, ToolLink};
use rohrpost_launch::survey::{ModuleSurvey, Scope, Standing, Survey};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost status mapper.0\nExit code 1: a module does not answer or is in error.")]
pub(crate) struct Arguments {
    /// Module to ask; all, if none is named.
    name: Option<String>,
    #[command(flatten)]
    target: Target,
    /// Timeout for an answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct StatusRow {
    module: String,
    node: String,
    #[serde(flatten)]
    account: Account,
    #[serde(flatten)]
    figures: Option<Figures>,
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
    let running = arguments.target.find()?;
    let (survey, silent) = running.survey(Scope::Modules)?;
    let named = arguments.name.as_deref().map(|name| running.module(name)).transpose()?;
    let names: Vec<Name> = match named {
        Some(name) => vec![name],
        None => {
            let need_run = |module: &&ModuleSurvey| !module.is_left_out(&running.installation);
            survey.modules.iter().filter(need_run).map(|module| module.name).collect()
        }
    };
    let mut tool = running.join(crate::terminal::units::seconds(arguments.timeout)?)?;
    let lines: Vec<StatusRow> =
        names.into_iter().map(|name| ask(&running, &mut tool, &survey, &silent, name)).collect();
    if arguments.json {
        say(serde_json::to_string(&lines)?);
    } else {
        say(print(&lines).trim_end());
    }
    let well = |line: &StatusRow| line.figures.is_some() && line.account.state != Standing::Error;
    Ok(if lines.iter().all(well) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A module's state: from launch, from its node's table, and from the module itself, unless it is known that it cannot
/// answer.
fn ask(running: &Running, tool: &mut ToolLink, survey: &Survey, silent: &[Silence], name: Name) -> StatusRow {
    let (text, node) = (running.text(name), running.node_of(name).to_owned());
    let account = survey.module(name).map(|module| Account::of(module, &running.installation));
    let silence = silent.iter().find(|silence| silence.node == node).map(Silence::text);
    let (failure, account) = match account {
        Some(account) if silence.is_none() && !account.state.answers() => {
            let busy = account.error.clone().filter(|_| account.state == Standing::Busy);
            let failure = Some(busy.unwrap_or_else(|| running.absent(name).to_string()));
            return StatusRow { module: text, node, account, figures: None, failure };
        }
        account => match silence.map_or_else(|| Ok(tool.status(name)), Err) {
            Ok(Ok(status)) => {
                let account = Account::said(&status, account);
                return StatusRow { module: text, node, account, figures: Some(Figures(status)), failure: None };
            }
            Ok(Err(error)) => (running.told(name, &error).to_string(), account),
            Err(silence) => (silence, account),
        },
    };
    let account = Account::unreachable(&failure, account);
    StatusRow { module: text, node, account, figures: None, failure: Some(failure) }
}

fn print(lines: &[StatusRow]) -> String {
    let rows = lines.iter().map(|line| {
        let figure = |of: fn(&Status) -> String| line.figures.as_ref().map_or("-".into(), |figures| of(&figures.0));
        [
            line.module.clone(),
            line.account.state.to_string(),
            figure(|status| time(Duration::from_millis(status.uptime_ms))),
            line.account.restarts.to_string(),
            figure(|status| status.subscribers.to_string()),
            figure(|status| status.missed.to_string()),
            figure(|status| status.lost.to_string()),
            plain::line(line.account.error.as_deref().unwrap_or_default()).into_owned(),
        ]
    });
    table(["module", "state", ">up", ">restarts", ">subscribers", ">missed", ">lost", "last error"], rows)
}
