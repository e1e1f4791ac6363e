//! Lists modules' output levels, and sets them at run time.

use super::arguments::{self, Arguments};
use crate::look::target::Running;
use crate::running::call;
use crate::terminal::table::table;
use crate::terminal::{Failure, complain, say};
use rohrpost::common::OutputLevel;
use rohrpost::{Name, ToolLink};
use rohrpost_config::Module;
use serde::Serialize;
use std::process::ExitCode;

/// A level for some modules.
pub(super) struct Setting {
    modules: Vec<Name>,
    level: OutputLevel,
}

impl Setting {
    pub(super) fn read(name: &str, level: &str, running: &Running) -> Result<Self, Failure> {
        let level = call::level_of(level)?;
        if name.contains('.') {
            return Ok(Self { modules: vec![arguments::module(name, running)?], level });
        }
        let class = arguments::class(name, &running.installation)?;
        let of_class = |module: &&Module| module.names().any(|name| name.class() == class);
        let nodes = running.shown();
        let meant = running.installation.modules.iter().filter(|module| nodes.contains(&module.node.as_str()));
        let modules: Vec<Name> = meant.filter(of_class).map(|module| module.name).collect();
        if modules.is_empty() {
            let word = if nodes.len() == 1 { "node" } else { "nodes" };
            return Err(format!("{word} `{}` has no module of class `{name}`", nodes.join("`, `")).into());
        }
        Ok(Self { modules, level })
    }
}

/// A module with its aliases: they are one process, and have one level.
fn names(module: Name, running: &Running) -> String {
    let names = running.installation.module(module).map(|module| module.names().collect()).unwrap_or(vec![module]);
    names.into_iter().map(|name| running.text(name)).collect::<Vec<_>>().join(" + ")
}

#[derive(Serialize)]
struct LevelArguments {
    module: String,
    level: &'static str,
    before: Option<&'static str>,
}

/// Sets levels and prints the previous ones. A failure does not prevent the others.
pub(super) fn set(settings: &[Setting], running: &Running, arguments: &Arguments, tool: &mut ToolLink) -> ExitCode {
    let mut code = ExitCode::SUCCESS;
    for (module, level) in settings.iter().flat_map(|set| set.modules.iter().map(|module| (*module, set.level))) {
        let set = match tool.output_level(module, level) {
            Ok(before) => LevelArguments {
                module: names(module, running),
                level: level.name(),
                before: before.map(OutputLevel::name),
            },
            Err(error) => {
                complain(format_args!(
                    "{}: its level is not set: {}",
                    running.text(module),
                    running.told(module, &error)
                ));
                code = ExitCode::FAILURE;
                continue;
            }
        };
        let text = match set.before {
            _ if arguments.json => serde_json::to_string(&set).unwrap_or_default(),
            Some(before) if before == set.level => format!("{}: {before}, as before", set.module),
            Some(before) => format!("{}: {}, was {before}", set.module, set.level),
            None => format!("{}: it sends no lines, whatever its level", set.module),
        };
        // On the standard error, so that it does not mix with lines.
        if arguments.follow {
            complain(text);
        } else {
            say(text);
        }
    }
    code
}

#[derive(Serialize)]
struct LevelRow {
    module: String,
    level: Option<&'static str>,
    at_start: &'static str,
    suppressed: u64,
    lost: u64,
    failure: Option<String>,
}

pub(super) fn list(running: &Running, json: bool, tool: &mut ToolLink) -> Result<ExitCode, Failure> {
    let mut lines = Vec::new();
    for (module, silence) in running.modules_to_ask()? {
        let status = match silence {
            Some(silence) => Err(silence.text()),
            None => tool.status(module).map_err(|error| running.told(module, &error).to_string()),
        };
        let (status, failure) = match status {
            Ok(status) => (Some(status), None),
            Err(why) => (None, Some(why)),
        };
        lines.push(LevelRow {
            module: names(module, running),
            level: status.as_ref().and_then(|status| status.output_level).map(OutputLevel::name),
            at_start: running.installation.output_level(module).as_str(),
            suppressed: status.as_ref().map_or(0, |status| status.output_suppressed),
            lost: status.as_ref().map_or(0, |status| status.output_lost),
            failure,
        });
    }
    if json {
        say(serde_json::to_string(&lines)?);
    } else {
        let rows = lines.iter().map(|line| {
            let (suppressed, lost) = (line.suppressed.to_string(), line.lost.to_string());
            let level = line.level.unwrap_or("-").into();
            let failure = line.failure.clone().unwrap_or_default();
            [line.module.clone(), level, line.at_start.into(), suppressed, lost, failure]
        });
        say(table(["module", "level", "at start", ">suppressed", ">lost", "error"], rows).trim_end());
    }
    let well = lines.iter().all(|line| line.failure.is_none());
    Ok(if well { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
