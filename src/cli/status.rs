//! `rohrpost status`.

use super::table::{table, time};
use super::target::Target;
use super::{Failure, say};
use rohrpost::common::{State, Status};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost status mapper.0\nExits with 1 when a module does not answer or is in error.")]
pub(super) struct Arguments {
    /// Module to ask; all, if none is named.
    name: Option<String>,
    #[command(flatten)]
    target: Target,
    /// Wait so long for an answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Line {
    module: String,
    node: String,
    #[serde(flatten)]
    status: Option<Status>,
    failure: Option<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let names = match &arguments.name {
        Some(name) => vec![(running.module(name)?, None)],
        None => running.modules_to_ask()?,
    };
    let mut tool = running.join(super::units::seconds(arguments.timeout)?)?;
    let mut lines = Vec::new();
    for (name, silence) in names {
        let (status, failure) = match silence.map_or_else(|| Ok(tool.status(name)), Err) {
            Ok(Ok(status)) => (Some(status), None),
            Ok(Err(error)) => (None, Some(running.told(name, &error).to_string())),
            Err(silence) => (None, Some(silence.text())),
        };
        lines.push(Line { module: running.text(name), node: running.node_of(name).into(), status, failure });
    }
    tool.close();
    if arguments.json {
        say(serde_json::to_string(&lines)?);
    } else {
        say(print(&lines).trim_end());
    }
    let well = |line: &Line| line.status.as_ref().is_some_and(|status| status.state != State::Error);
    Ok(if lines.iter().all(well) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn print(lines: &[Line]) -> String {
    let rows = lines.iter().map(|line| match &line.status {
        Some(status) => [
            line.module.clone(),
            format!("{:?}", status.state).to_lowercase(),
            time(Duration::from_millis(status.uptime_ms)),
            status.subscribers.to_string(),
            status.missed.to_string(),
            status.lost.to_string(),
            status.error.clone(),
        ],
        None => {
            let dash = || "-".to_owned();
            let failure = line.failure.clone().unwrap_or_default();
            [line.module.clone(), "silent".into(), dash(), dash(), dash(), dash(), failure]
        }
    });
    table(["module", "state", ">up", ">subscribers", ">missed", ">lost", "error"], rows)
}
