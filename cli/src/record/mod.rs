//! `rohrpost record`: files of recordings, described, made whole, cut and merged. Looks at no running node.

mod change;
mod info;
mod progress;
mod time;

use crate::terminal::Failure;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost record info base-0001.mcap                             what is in a file
  rohrpost record recover base-0003.mcap                          makes base-0003.recovered.mcap
  rohrpost record cut base-0001.mcap part.mcap --from +10s --until +20s
  rohrpost record cut base-0001.mcap scans.mcap laser.0 odometry.0/pose
  rohrpost record merge all.mcap base-0001.mcap base-0002.mcap arm-0001.mcap
No file is ever changed or overwritten. Rerun, Foxglove and other programs read the files, too (MCAP).")]
pub(super) struct Arguments {
    #[command(subcommand)]
    action: RecordCommand,
}

#[derive(clap::Subcommand)]
enum RecordCommand {
    /// Show what is in files: channels, types, times, losses, and whether they were closed.
    Info(info::RecordingInfoArguments),
    /// Make a whole file of one that was cut off or damaged; the old one stays.
    Recover(change::RecoverArguments),
    /// Copy a time range, or some names, into a new file.
    Cut(change::CutArguments),
    /// Copy several files into a new one, ordered by time of arrival.
    Merge(change::MergeArguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        RecordCommand::Info(arguments) => info::run(arguments),
        RecordCommand::Recover(arguments) => change::recover(arguments),
        RecordCommand::Cut(arguments) => change::cut(arguments),
        RecordCommand::Merge(arguments) => change::merge(arguments),
    }
}
