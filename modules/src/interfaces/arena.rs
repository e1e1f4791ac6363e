//! A simulated world of many robots: true places, and what its referee notes.

use super::{TeamCell, TeamPlace};
use crate::interface;
use crate::types::{Pose, Twist};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// A robot as it really is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ArenaRobot {
    /// System number of the robot.
    pub robot: u8,
    /// Where it is, on the team's map.
    pub pose: Pose,
    /// How it moves.
    pub twist: Twist,
    /// Radius of its body.
    #[schema(unit = "m")]
    pub radius_m: f64,
    /// The cell in which its middle is.
    pub cell: Option<TeamCell>,
}

/// An intruder as it really is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ArenaIntruder {
    /// Number of the intruder: they are counted from 0.
    pub number: u32,
    /// Its middle, on the team's map.
    pub place: TeamPlace,
    /// Radius of its body.
    #[schema(unit = "m")]
    pub radius_m: f64,
    /// The cell in which its middle is.
    pub cell: Option<TeamCell>,
    /// Paths beside it that a robot can reach, and in which none is.
    pub open: Vec<TeamCell>,
}

/// How often robots did what they must not. Counts are since the arena began, and only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ArenaCounts {
    /// Touches by robots that moved towards what they touched.
    pub touches_towards: u64,
    /// All touches.
    pub touches: u64,
    /// How often a robot came into a cell in which another one was.
    pub two_in_cell: u64,
    /// How often two robots swapped cells.
    pub swaps: u64,
}

/// All bodies of an arena, and what its referee has counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ArenaState {
    /// Digest of the map, as teams tell it.
    pub map: u64,
    /// All robots, by number.
    pub robots: Vec<ArenaRobot>,
    /// All intruders, by number.
    pub intruders: Vec<ArenaIntruder>,
    /// What the referee has counted.
    pub counts: ArenaCounts,
}

/// A kind of what robots must not do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "kebab-case")] // in JSON; postcard knows numbers only
pub enum ArenaMishap {
    /// A robot that moved towards something has met it.
    #[default]
    Touch,
    /// A robot has met something towards which it did not move.
    Contact,
    /// A robot has come into a cell in which another one is.
    TwoInCell,
    /// Two robots have swapped cells.
    Swap,
}

/// What robots must not do, as it happened.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ArenaIncident {
    /// Incidents before this one.
    pub number: u64,
    /// What kind it is.
    pub mishap: ArenaMishap,
    /// Robots that took part, the one that moved first.
    pub robots: Vec<u8>,
    /// Where the first of them was.
    pub place: TeamPlace,
    /// Time, and what happened, in words.
    pub text: String,
}

/// How an intruder behaves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "kebab-case")] // in JSON; postcard knows numbers only
pub enum ArenaConduct {
    /// Never moves.
    #[default]
    Stands,
    /// Goes to these cells by shortest paths, then stands.
    Script {
        /// Metres a second.
        speed_m_s: f64,
        /// Cells to go to, the first one first.
        cells: Vec<TeamCell>,
    },
    /// Goes to the cell beside it that is furthest from all robots.
    Flees {
        /// Metres a second.
        speed_m_s: f64,
        /// Stands while no robot is so near, metres.
        fears_m: f64,
    },
}

/// Why a call was refused, in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
#[error("{0}")]
pub struct ArenaRefusal(pub String);

/// Moves the bodies of simulated robots and intruders, and notes what robots must not do.
#[interface(class = "arena", crate = crate::macro_support)]
pub trait Arena {
    /// Puts an intruder into a cell. Returns its number.
    #[command(16)]
    fn add_intruder(&mut self, cell: TeamCell, conduct: ArenaConduct) -> Result<u32, ArenaRefusal>;

    /// Puts a robot into another cell, as a person would: its odometry does not notice.
    #[command(17)]
    fn push(&mut self, robot: u8, cell: TeamCell) -> Result<(), ArenaRefusal>;

    /// All bodies, five times a second.
    #[data(1)]
    fn state() -> ArenaState;

    /// What robots must not do, each when it happens.
    #[data(2)]
    fn incident() -> ArenaIncident;
}
