//! `rohrpost check`, and the reading of a configuration with all that can be known of it before anything runs.

mod json;

use super::{Failure, daemons, say};
use rohrpost::config::{Errors, Installation, MissingProgram, TimeSource, explain};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost check config/demo.toml
  rohrpost check robot.toml --json         mistakes with file and line, or what the file means, for programs")]
pub(super) struct Arguments {
    /// The configuration.
    file: PathBuf,
    /// Explain this node only.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Print mistakes, or what the file means, as JSON.
    #[arg(long)]
    json: bool,
}

/// Reads a configuration, and asks the built-in modules whether they could work with it.
///
/// # Errors
/// Everything that is wrong, by line.
pub(super) fn load(file: &Path) -> Result<Installation, Errors> {
    judge(Installation::load(file)?)
}

/// Asks the built-in modules of an installation whether they could work with it.
///
/// # Errors
/// Everything that they would refuse, by line.
pub(super) fn judge(installation: Installation) -> Result<Installation, Errors> {
    let problems = rohrpost_modules::builtin::check(&installation);
    if !problems.is_empty() {
        return Err(Errors::new(&installation.path, problems));
    }
    let problems = rohrpost_modules::builtin::check_saved(&installation);
    match &installation.saved {
        Some(saved) if !problems.is_empty() => Err(Errors::new(&saved.path, problems)),
        _ => Ok(installation),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = match load(&arguments.file) {
        Err(errors) if arguments.json => {
            say(json::errors(&errors));
            return Ok(ExitCode::FAILURE);
        }
        loaded => loaded?,
    };
    let only = arguments.node.as_deref();
    if only.is_some() {
        rohrpost::launch::choose_node(&installation, only)?;
    }
    let missing = missing_programs(&installation, only)?;
    if arguments.json {
        say(json::installation(&installation, only, &missing));
        return Ok(ExitCode::SUCCESS);
    }
    say(explain(&installation, only).trim_end());
    for program in missing {
        say(format_args!("note: {program}"));
    }
    if let TimeSource::Master { .. } = installation.time {
        for daemon in daemons::running(Path::new("/proc")) {
            say(format_args!(
                "note: {} runs on this computer; if that is a node, end it: {}; {}",
                daemon.name,
                daemon.ends,
                daemons::WHY
            ));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// On which computer this runs is not said; a missing program is an error only where its node will be launched.
fn missing_programs(installation: &Installation, only: Option<&str>) -> Result<Vec<MissingProgram>, Failure> {
    let beside = std::env::current_exe()?.parent().map(PathBuf::from).unwrap_or_default();
    let nodes = installation.nodes.iter().filter(|node| only.is_none_or(|name| name == node.name));
    Ok(nodes.flat_map(|node| installation.missing_programs(&node.name, &beside)).collect())
}
