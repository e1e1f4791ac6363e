//! `rohrpost replay`: what was recorded, once more.

use crate::exact::{self, ExactArguments};
use crate::terminal::Failure;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost replay --exact base-0001.mcap                       all modules that have a journal there
  rohrpost replay --exact base-0001.mcap pilot.0 mapper.0
  rohrpost replay --exact base-0001.mcap pilot.0 --program target/debug/pilot
  rohrpost replay --exact base-0001.mcap pilot.0 --list | less
No node runs for it, and none is disturbed. Modules have a journal if `exact` of [record] names them.")]
pub(super) struct Arguments {
    /// Run the programs of modules again with what they were called with and told, and compare all that they do.
    #[arg(long, required = true)]
    exact: bool,
    /// Recording.
    file: PathBuf,
    /// Modules; all that have a journal, if none is named.
    modules: Vec<String>,
    /// Another build of the module's program.
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
    /// Folder that stands for that of the configuration: files that its settings name are there.
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// Print what is in the journals instead, entry by entry.
    #[arg(long, conflicts_with = "json")]
    list: bool,
    /// One JSON object a run of a module.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: Arguments) -> Result<ExitCode, Failure> {
    let Arguments { file, modules, program, folder, list, json, .. } = arguments;
    exact::run(&ExactArguments { file, modules, program, folder, list, json })
}
