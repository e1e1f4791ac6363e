//! `rohrpost man`: manual pages, made of the parser of the command line.

use crate::terminal::{Failure, say};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example:
  rohrpost man ~/.local/share/man/man1 && man rohrpost-top")]
pub(crate) struct Arguments {
    /// Folder for the pages; it is made if it is not there.
    folder: PathBuf,
}

/// Writes a page for the command, and one for each of its subcommands.
pub(crate) fn run(arguments: &Arguments, command: clap::Command) -> Result<ExitCode, Failure> {
    let folder = &arguments.folder;
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
    written
        .map_err(|error| format!("manual pages in {}: {error}; name a folder that you may write", folder.display()))?;
    say(format_args!("manual pages are in {}; `man {0}/rohrpost.1` shows the first", folder.display()));
    Ok(ExitCode::SUCCESS)
}
