//! What a robot of a team does: its mode, its way, and the exits of intruders as it has shared them out.

use super::TeamObjectId;
use crate::interface;
use crate::types::Pose;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// A cell of the team's map, counted from 0 at the upper left of its file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema)]
pub struct TeamCell {
    /// Cells to the left.
    pub column: u32,
    /// Cells above.
    pub row: u32,
}

/// A place on the team's map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct TeamPlace {
    /// Metres along x.
    #[schema(unit = "m")]
    pub x_m: f64,
    /// Metres along y.
    #[schema(unit = "m")]
    pub y_m: f64,
}

/// What a robot does, by what its view has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum PayloadMode {
    /// The view has no intruder.
    #[default]
    Wandering,
    /// There is an intruder, and nobody is certain where.
    Searching,
    /// The place of at least one is certain.
    Blocking,
}

/// An exit of an intruder: a path beside it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct PayloadExit {
    /// Which intruder.
    pub intruder: TeamObjectId,
    /// The cell of the exit.
    pub cell: TeamCell,
    /// The middle of that cell.
    pub place: TeamPlace,
    /// The robot that is to hold it; none: it is open.
    pub holder: Option<u8>,
    /// Why nobody is to hold it, in words; empty if a robot is.
    pub why_open: String,
}

/// A robot that has no part in holding exits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PayloadIdle {
    /// System number of the robot.
    pub robot: u8,
    /// The reason, in words.
    pub why: String,
}

/// How late the beats of a robot were. Counts are since its program began, and only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PayloadBeats {
    /// All beats.
    pub beats: u64,
    /// Beats that were late by more than 10 ms.
    pub over_10_ms: u64,
    /// Beats that were late by more than 50 ms.
    pub over_50_ms: u64,
    /// The latest one.
    #[schema(unit = "us")]
    pub latest_us: u64,
}

/// A robot's program, as it is now.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct PayloadState {
    /// System number of the robot.
    pub robot: u8,
    /// What the robot does.
    pub mode: PayloadMode,
    /// Why the robot does not know its cell, and stands; empty: it knows.
    pub lost: String,
    /// Where it is on the team's map; none before the first pose.
    pub pose: Option<Pose>,
    /// The cell in which it is; none while it is lost.
    pub cell: Option<TeamCell>,
    /// Where its way ends; none without such a place.
    pub destination: Option<TeamPlace>,
    /// Middles of the cells of its way, as far as they are planned: the next one first.
    pub way: Vec<TeamPlace>,
    /// Exits of all certain intruders, as this robot has shared them out; empty while it does not block.
    pub exits: Vec<PayloadExit>,
    /// Robots that have no part in that.
    pub idle: Vec<PayloadIdle>,
    /// How late its beats were.
    pub beats: PayloadBeats,
}

/// Drives a robot of a team: it wanders, searches intruders and blocks them. The class `team` beside it tells what the
/// robot knows of the others, the class `wormhole` which program drives.
#[interface(class = "payload", crate = crate::macro_support)]
pub trait Payload {
    /// Tells all stations a text, at most 1000 characters of it.
    #[command(16)]
    fn say(&mut self, text: String);

    /// The robot's program, each beat.
    #[data(1)]
    fn state() -> PayloadState;
}
