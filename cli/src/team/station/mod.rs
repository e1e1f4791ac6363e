//! `rohrpost station`: a person's place in a team (seed 000, 4.5.3 and A.4).

mod ask;
mod fake;
mod link;
mod watch;

use super::two_files;
use crate::terminal::Failure;
use clap::Subcommand;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost station info\nRobots are named by their systems, as `rohrpost team` shows \
    them: in a hosts file, one more than the id.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: StationCommand,
}

#[derive(Subcommand)]
enum StationCommand {
    /// Start a station from the team's two files.
    Start(two_files::Arguments),
    /// Show the team live, on its map.
    Watch(watch::Arguments),
    /// Ask robots what they do and see.
    Info(ask::StationInfoArguments),
    /// Tell robots to end.
    Quit(ask::QuitArguments),
    /// Make up intruders, move and remove them.
    Fake(fake::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.command {
        StationCommand::Start(arguments) => two_files::start(arguments, two_files::TeamProgram::Station),
        StationCommand::Watch(arguments) => watch::run(arguments),
        StationCommand::Info(arguments) => ask::info(arguments),
        StationCommand::Quit(arguments) => ask::quit(arguments),
        StationCommand::Fake(arguments) => fake::run(arguments),
    }
}
