//! `rohrpost record`: files of recordings, described, made whole, cut, merged and exported, without a look at any
//! running node; and orders to the recorder that runs.

mod change;
mod control;
mod export;
mod info;
mod jsonl;
mod part;
mod progress;
mod time;

use crate::terminal::Failure;
pub(crate) use part::PartArguments;
pub(crate) use progress::ProgressLine;
use rohrpost_recording::ControlCommand;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost record info base-0001.mcap                             what is in a file
  rohrpost record recover base-0003.mcap                          makes base-0003.recovered.mcap
  rohrpost record cut base-0001.mcap -o part.mcap --from +10s --until +20s
  rohrpost record cut base-0001.mcap -o scans.mcap --names laser.0 odometry.0/pose
  rohrpost record merge base-0001.mcap base-0002.mcap arm-0001.mcap -o all.mcap
  rohrpost record export base-0001.mcap -o drawn.mcap --format drawn --rate 10; rerun drawn.mcap
  rohrpost record export base-0001.mcap -o - --format json --names pilot.0
  rohrpost record mark door open                                  marks this moment in the recording that runs
  rohrpost record rotate                                          closes its file, and begins the next
No file is ever changed or overwritten. Other programs read the files, too (MCAP); Rerun and Foxglove draw what is
exported.")]
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
    /// Make a file for others: what Rerun and Foxglove draw, or JSON.
    Export(export::ExportArguments),
    /// Have the recorder of the running node record.
    On(control::RecorderTarget),
    /// Have it end the recording: its file is closed, and no other begun.
    Off(control::RecorderTarget),
    /// Have it make its files in another folder below the configured one.
    Directory(control::DirectoryArguments),
    /// Say whether it records, where to, and what became of all messages.
    Status(control::RecorderTarget),
    /// Set a mark in its file: the time, and a text. `record info` lists marks.
    Mark(control::MarkArguments),
    /// Have it close its file, and begin the next.
    Rotate(control::RecorderTarget),
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        RecordCommand::Info(arguments) => info::run(arguments),
        RecordCommand::Recover(arguments) => change::recover(arguments),
        RecordCommand::Cut(arguments) => change::cut(arguments),
        RecordCommand::Merge(arguments) => change::merge(arguments),
        RecordCommand::Export(arguments) => export::run(arguments),
        RecordCommand::On(recorder) => control::order(&ControlCommand::On, recorder),
        RecordCommand::Off(recorder) => control::order(&ControlCommand::Off, recorder),
        RecordCommand::Directory(arguments) => control::directory(arguments),
        RecordCommand::Status(recorder) => control::order(&ControlCommand::Status, recorder),
        RecordCommand::Mark(arguments) => control::mark(arguments),
        RecordCommand::Rotate(recorder) => control::order(&ControlCommand::Rotate, recorder),
    }
}
