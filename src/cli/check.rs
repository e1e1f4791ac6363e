//! `rohrpost check`.

use super::{Failure, say};
use rohrpost::config::{Installation, explain};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost check config/demo.toml")]
pub(super) struct Arguments {
    /// The configuration.
    file: PathBuf,
    /// Explain this node only.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = Installation::load(&arguments.file)?;
    if let Some(node) = &arguments.node {
        rohrpost::launch::choose_node(&installation, Some(node))?;
    }
    say(explain(&installation, arguments.node.as_deref()).trim_end());
    let beside = std::env::current_exe()?.parent().map(PathBuf::from).unwrap_or_default();
    // On which computer this runs is not said; a missing program is an error only where its node will be launched.
    for node in installation.nodes.iter().filter(|node| arguments.node.as_ref().is_none_or(|name| *name == node.name)) {
        for program in installation.missing_programs(&node.name, &beside) {
            say(format_args!("note: {program}"));
        }
    }
    Ok(ExitCode::SUCCESS)
}
