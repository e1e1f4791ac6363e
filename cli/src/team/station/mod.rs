//! `rohrpost station`: a person's place in a team (seed 000, 4.5.3 and A.4).

mod ask;
mod fake;
mod watch;

use super::two_files;
use crate::look::newest;
use crate::look::observer::Tool;
use crate::look::target::{Inquiry, Running};
use crate::terminal::Failure;
use clap::Subcommand;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{StationInterface, StationState, TeamRefusal};
use rohrpost::wire::{append, from_bytes};
use rohrpost_mailbox::Name;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost station info\nRobots are named by their systems, as `rohrpost team` shows \
    them: in a hosts file, one more than the id.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Start a station from the team's two files.
    Start(two_files::Arguments),
    /// Show the team live, on its map.
    Watch(watch::Arguments),
    /// Ask robots what they do and see.
    Info(ask::InfoArguments),
    /// Tell robots to end.
    Quit(ask::QuitArguments),
    /// Make up intruders, move and remove them.
    Fake(fake::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.command {
        Command::Start(arguments) => two_files::start(arguments, two_files::Host::Station),
        Command::Watch(arguments) => watch::run(arguments),
        Command::Info(arguments) => ask::info(arguments),
        Command::Quit(arguments) => ask::quit(arguments),
        Command::Fake(arguments) => fake::run(arguments),
    }
}

/// The station that runs here.
struct StationLink {
    running: Running,
    tool: Tool,
    module: Name,
}

impl StationLink {
    fn find(inquiry: &Inquiry) -> Result<Self, Failure> {
        let running = inquiry.target.find()?;
        let module = running.module(StationInterface::CLASS)?;
        let tool = running.join(inquiry.timeout()?)?;
        Ok(Self { running, tool, module })
    }

    /// Calls a function that may refuse.
    fn call<T: DeserializeOwned>(&mut self, function: u16, arguments: &impl Serialize) -> Result<T, Failure> {
        let write = |body: &mut Vec<u8>| append(body, arguments);
        let read = |bytes: &[u8]| from_bytes::<Result<T, TeamRefusal>>(bytes);
        let answer = self.tool.call(self.module, function, StationInterface::hash(), write, read);
        Ok(answer.map_err(|error| self.running.told(self.module, &error))??)
    }

    fn state(&mut self) -> Result<StationState, Failure> {
        let newest = newest(&mut self.tool, self.module, StationInterface::STATE);
        newest.map(|(_, state)| state).map_err(|error| self.running.told(self.module, &error))
    }
}
