//! A station: where a person sees the team, makes up intruders, and asks mobiles.

use super::{TeamObjectId, TeamRefusal};
use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// What a station asks of mobiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum StationRequestKind {
    /// A mobile is to send its view as a text.
    #[default]
    Info,
    /// A mobile is to end.
    Quit,
}

/// How it stands with a robot that was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "kebab-case")] // in JSON; postcard knows numbers only
pub enum StationAnswer {
    /// No answer yet; the robot is asked in each beat.
    #[default]
    Waiting,
    /// The robot does what is asked.
    Done,
    /// The robot does not obey this station.
    Refused,
    /// Another station, which is not meant.
    Station,
    /// The robot was restarted meanwhile; the new run was not asked.
    Restarted,
    /// No answer in time; whether the robot did what was asked, nobody knows.
    GivenUp,
}

/// A robot that was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct StationRobot {
    /// System number of the robot.
    pub robot: u8,
    /// How it stands with it.
    pub answer: StationAnswer,
}

/// What a person has asked.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct StationRequest {
    /// Number of the request in this run of the station.
    pub number: u32,
    /// What is asked.
    pub kind: StationRequestKind,
    /// Since it was asked first.
    #[schema(unit = "ms")]
    pub age_ms: u64,
    /// How often it was sent.
    #[schema(unit = "times")]
    pub tries: u32,
    /// Whether nobody is waited for.
    pub over: bool,
    /// The robots that were asked, by number.
    pub robots: Vec<StationRobot>,
}

/// A text of a mobile.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct StationMessage {
    /// System number of the mobile.
    pub robot: u8,
    /// Since it came.
    #[schema(unit = "ms")]
    pub age_ms: u64,
    /// Number of the request that it answers.
    pub answers: Option<u32>,
    /// What it says.
    pub text: String,
}

/// What a station has asked and heard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct StationState {
    /// System number of the station.
    pub robot: u8,
    /// Run of the station; a restart begins the next one, which remembers nothing.
    pub incarnation: u32,
    /// What was asked, oldest first.
    pub requests: Vec<StationRequest>,
    /// What mobiles said, oldest first: the newest that fit 24 KiB.
    pub messages: Vec<StationMessage>,
    /// Messages before these.
    pub more_messages: u32,
}

/// A person's place in a team: takes part without a body, and never holds an exit. The class `team` beside it tells
/// what it knows of the others.
#[interface(class = "station", crate = crate::macro_support)]
pub trait Station {
    /// Makes up an intruder at a place of the team's map; all show it as fake. Only `remove_fake` ends it.
    #[command(16)]
    fn set_fake(&mut self, x_m: f64, y_m: f64) -> Result<TeamObjectId, TeamRefusal>;

    /// Moves an intruder that this station made up.
    #[command(17)]
    fn move_fake(&mut self, id: TeamObjectId, x_m: f64, y_m: f64) -> Result<(), TeamRefusal>;

    /// Removes an intruder that this station made up.
    #[command(18)]
    fn remove_fake(&mut self, id: TeamObjectId) -> Result<(), TeamRefusal>;

    /// Asks something of one robot, or of all that are heard, until each has answered or is given up. Returns the
    /// number of the request.
    #[command(19)]
    fn ask(&mut self, kind: StationRequestKind, robot: Option<u8>) -> Result<u32, TeamRefusal>;

    /// What the station has asked and heard, each beat.
    #[data(1)]
    fn state() -> StationState;
}
