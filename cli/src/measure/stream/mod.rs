//! `rohrpost stream`: streams of records, seen from outside, read, and written by hand.
//!
//! A stream lies in the shared memory of its node, so these tools run on the computer of that node; of other nodes
//! `list` shows what their launches see. `list` and `info` take no reader's seat; `read` and `interp` take one. What
//! the bytes mean is in the description that the module which writes has left beside its mailbox; without one they are
//! told as they are.

mod between;
mod choice;
mod interp;
mod list;
mod output;
mod read;
mod refusal;
mod stamp;
mod view;
mod write;

use crate::terminal::Failure;
pub(crate) use choice::{item_of, too_large_for_data};
pub(crate) use stamp::{Offset, parse_offset, parse_stamp, stamp_text};
use std::process::ExitCode;
pub(crate) use view::{StreamView, name_items, print_streams, stream_views};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream list                                       the streams of all nodes
  rohrpost stream info camera.0 image                        all that is known of one
  rohrpost stream read odometry.0 odometry                   its newest record
  rohrpost stream read odometry.0 odometry --at -1.5s        the two records around a time
  rohrpost stream interp odometry.0 odometry --at -1.5s      the value at that time
  rohrpost stream write camera.0 40 a.jpg b.jpg --delay 0.1")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: StreamCommand,
}

#[derive(clap::Subcommand)]
enum StreamCommand {
    /// List the streams of all nodes, or of one; disturbs nobody.
    List(list::ListArguments),
    /// Show one stream: its writer, readers and limits; disturbs nobody.
    Info(list::InfoArguments),
    /// Print records: the newest, the next ones, or the two around a time.
    Read(read::ReadArguments),
    /// Print the value at a time, interpolated between the two records around it, or why there is none.
    Interp(interp::InterpArguments),
    /// Write files, each as a record; refused while a module writes.
    Write(write::WriteArguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        StreamCommand::List(arguments) => list::list(arguments),
        StreamCommand::Info(arguments) => list::info(arguments),
        StreamCommand::Read(arguments) => read::run(arguments),
        StreamCommand::Interp(arguments) => interp::run(arguments),
        StreamCommand::Write(arguments) => write::run(arguments),
    }
}
