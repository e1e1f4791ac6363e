//! `rohrpost station fake`: intruders that a person makes up.

use super::link::StationLink;
use crate::look::target::Inquiry;
use crate::terminal::{Failure, say};
use clap::Subcommand;
use rohrpost::interfaces::TeamObjectId;
use serde_json::json;
use std::process::ExitCode;
use std::str::FromStr;

/// Functions of a station.
pub(super) const SET: u16 = 16;
pub(super) const MOVE: u16 = 17;
pub(super) const REMOVE: u16 = 18;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost station fake set 6.5 1.5
  rohrpost station fake move 6-1.1 7.5 1.5
  rohrpost station fake remove 6-1.1
Places are metres on the team's map. All show it as fake, and only this station moves or removes it.")]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: FakeCommand,
}

#[derive(Subcommand)]
enum FakeCommand {
    /// Make one up; prints its name.
    #[command(after_help = "Example: rohrpost station fake set 6.5 1.5")]
    Set {
        #[command(flatten)]
        place: FakePlace,
        #[command(flatten)]
        inquiry: Inquiry,
    },
    /// Move one.
    #[command(after_help = "Example: rohrpost station fake move 6-1.1 7.5 1.5")]
    Move {
        /// Name of the intruder, as `rohrpost team` shows it.
        name: FakeName,
        #[command(flatten)]
        place: FakePlace,
        #[command(flatten)]
        inquiry: Inquiry,
    },
    /// Remove one.
    #[command(after_help = "Example: rohrpost station fake remove 6-1.1")]
    Remove {
        /// Name of the intruder, as `rohrpost team` shows it.
        name: FakeName,
        #[command(flatten)]
        inquiry: Inquiry,
    },
}

#[derive(clap::Args)]
struct FakePlace {
    /// Metres along x.
    #[arg(allow_negative_numbers = true)]
    x_m: f64,
    /// Metres along y.
    #[arg(allow_negative_numbers = true)]
    y_m: f64,
}

/// Observer, incarnation and number: `6-1.1`.
#[derive(Clone, Copy)]
struct FakeName(TeamObjectId);

impl FromStr for FakeName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (observer, rest) = text.split_once('-')?;
            let (incarnation, number) = rest.split_once('.')?;
            let id = TeamObjectId {
                observer: observer.parse().ok()?,
                incarnation: incarnation.parse().ok()?,
                number: number.parse().ok()?,
            };
            Some(Self(id))
        };
        read().ok_or_else(|| "no name of an intruder; `rohrpost team` shows names, such as 6-1.1".into())
    }
}

/// The name of an intruder, as `rohrpost team` shows it.
pub(super) fn name(id: TeamObjectId) -> String {
    format!("{}-{}.{}", id.observer, id.incarnation, id.number)
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (inquiry, id, what) = match &arguments.command {
        FakeCommand::Set { place, inquiry } => {
            let id = StationLink::find(inquiry)?.call(SET, &(place.x_m, place.y_m))?;
            (inquiry, id, "set")
        }
        FakeCommand::Move { name: FakeName(id), place, inquiry } => {
            StationLink::find(inquiry)?.call::<()>(MOVE, &(id, place.x_m, place.y_m))?;
            (inquiry, *id, "moved")
        }
        FakeCommand::Remove { name: FakeName(id), inquiry } => {
            StationLink::find(inquiry)?.call::<()>(REMOVE, &(id,))?;
            (inquiry, *id, "removed")
        }
    };
    let name = name(id);
    say(if inquiry.json { json!({ "name": name, "id": id }).to_string() } else { format!("{name} {what}") });
    Ok(ExitCode::SUCCESS)
}
