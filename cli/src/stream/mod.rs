//! `rohrpost stream`: streams of records, seen from outside, read, and written by hand.
//!
//! A stream lies in the shared memory of its node, so these tools run on the computer of that node. `list` and `info`
//! take no reader's seat; `read` takes one. What the bytes mean is not known here.

mod choice;
mod list;
mod output;
mod read;
mod stamp;
mod view;
mod write;

use crate::terminal::Failure;
pub(super) use choice::{completed_names, completed_numbers};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream list                                  all streams of this node
  rohrpost stream info camera.0 1                       all that is known of one
  rohrpost stream read camera.0 1                       its newest record
  rohrpost stream read camera.0 1 --at 1700000000.25    the two records around a time
  rohrpost stream write camera.0 1 a.jpg b.jpg --delay 0.1")]
pub(super) struct Arguments {
    #[command(subcommand)]
    action: StreamCommand,
}

#[derive(clap::Subcommand)]
enum StreamCommand {
    /// List the streams of a node; disturbs nobody.
    List(list::ListArguments),
    /// Show one stream: its writer, readers and limits; disturbs nobody.
    Info(list::InfoArguments),
    /// Print records: the newest, the next ones, or the two around a time.
    Read(read::ReadArguments),
    /// Write files, each as a record; refused while a module writes.
    Write(write::WriteArguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        StreamCommand::List(arguments) => list::list(arguments),
        StreamCommand::Info(arguments) => list::info(arguments),
        StreamCommand::Read(arguments) => read::run(arguments),
        StreamCommand::Write(arguments) => write::run(arguments),
    }
}
