//! A robot's team, seen by tools, drawings and programs that plan with others.

use crate::interface;
use crate::types::Pose;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// How another clock differs from this robot's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamClock {
    /// The other clock minus this robot's.
    #[schema(unit = "ns")]
    pub offset_ns: i64,
    /// Greatest error of the offset.
    #[schema(unit = "ns")]
    pub bound_ns: u64,
}

/// Another robot of the team, in contact or not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct TeamMember {
    /// System number of the robot.
    pub robot: u8,
    /// Run of the robot; a restart begins the next one.
    pub incarnation: u32,
    /// Number of its newest hello in this run.
    pub counter: u32,
    /// Whether the robot counts as alive: leader and group are chosen among these.
    pub fresh: bool,
    /// Age of its newest hello that is known here. The robot is out of contact for so long, if it is not fresh.
    #[schema(unit = "ms")]
    pub silent_ms: u64,
    /// Robots through which that hello came; 0: it came here itself.
    pub hops: u8,
    /// Whether its hellos come here themselves now.
    pub direct: bool,
    /// Whether its view is that of all robots that it hears, as it says itself.
    pub agrees: bool,
    /// Robots of which it hears the hellos itself, as it said last; empty beyond the first 16 384 of all members.
    pub hears: Vec<u8>,
    /// Last known place, on the team's map; none of a robot that was never heard directly.
    pub pose: Option<Pose>,
    /// Age of the pose; 0 without one.
    #[schema(unit = "ms")]
    pub pose_age_ms: u64,
    /// Clock of the robot, as long as both hear each other.
    pub clock: Option<TeamClock>,
}

/// Something that a person should know of a robot, and that harms nobody.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "kebab-case")] // in JSON; postcard knows numbers only
pub enum TeamNoticeKind {
    /// Two robots have this number. One of them may be this one.
    DuplicateId,
    /// The robot has another map: records are not exchanged with it.
    OtherMap,
    /// The robot has another tree of events: its events are refused.
    OtherTree,
    /// The robot's clock differs by more than clocks of one team should.
    ClockOff,
}

/// A notice of one robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamNotice {
    /// System number of the robot.
    pub robot: u8,
    /// What there is to know.
    pub kind: TeamNoticeKind,
}

/// Name of an object: its first observer, and the version of the first sighting there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamObjectId {
    /// System number of the robot, or of the station that made the object up.
    pub observer: u8,
    /// Incarnation of the observer.
    pub incarnation: u32,
    /// Number of the sighting in that incarnation.
    pub number: u32,
}

/// An intruder, as all records of the team together tell of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct TeamObject {
    /// Name of the object, the same for all robots with the same records.
    pub id: TeamObjectId,
    /// Place on the team's map.
    #[schema(unit = "m")]
    pub x_m: f64,
    /// Place on the team's map.
    #[schema(unit = "m")]
    pub y_m: f64,
    /// Whether it is there now, as far as anybody can know.
    pub certain: bool,
    /// Whether a station made it up.
    pub fake: bool,
    /// The silent robot that it may be.
    pub may_be: Option<u8>,
    /// Robots that have records of it.
    pub observers: Vec<u8>,
    /// Since anybody saw it last, at least.
    #[schema(unit = "ms")]
    pub seen_ms: u64,
}

/// What this robot's team module did and met. Counts are since it began, and only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamCounts {
    /// Hellos that it sent, one a beat.
    pub hellos_sent: u64,
    /// Messages of new records that it sent.
    pub records_sent: u64,
    /// Synchros that it sent: whole records that a digest showed missing.
    pub synchros_sent: u64,
    /// Messages that found no way out.
    pub unsent: u64,
    /// Hellos of others that came.
    pub hellos_heard: u64,
    /// Messages of records, and synchros, of others that came.
    pub records_heard: u64,
    /// Messages that were none, or not in the name of the robot that sent them.
    pub malformed: u64,
}

/// A robot's team, as the robot knows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct TeamState {
    /// System number of the robot that tells this.
    pub robot: u8,
    /// Run of the robot; a restart begins the next one.
    pub incarnation: u32,
    /// Number of its newest hello in this run.
    pub counter: u32,
    /// From one hello to the next.
    #[schema(unit = "ms")]
    pub beat_ms: u32,
    /// Where the robot is, on the team's map; none while it does not know.
    pub pose: Option<Pose>,
    /// Digest of the map.
    pub map: u64,
    /// The fresh robot with the least number, this one included.
    pub leader: u8,
    /// The fresh robot with the greatest number, this one included: the group's name.
    pub group: u8,
    /// For how long views of fresh robots have differed, as far as this one knows; none: they are equal.
    #[schema(unit = "ms")]
    pub differs_ms: Option<u64>,
    /// Number of the hello since which fresh members, and so leader and group, are as they are.
    pub settled: u32,
    /// Number of the hello since which views are equal, or differ.
    pub views_settled: u32,
    /// Digests of the records: robots with equal digests have equal records.
    pub digests: Vec<u32>,
    /// Clock of the leader, the team's time, if it is known.
    pub team_clock: Option<TeamClock>,
    /// All other robots that were ever heard of, by ascending number.
    pub members: Vec<TeamMember>,
    /// What a person should know.
    pub notices: Vec<TeamNotice>,
    /// Intruders, by ascending id; at most 16 KiB of them.
    pub objects: Vec<TeamObject>,
    /// Intruders beyond these.
    pub more_objects: u32,
    /// What the module did and met.
    pub counts: TeamCounts,
}

/// Why a call was refused, in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
#[error("{0}")]
pub struct TeamRefusal(pub String);

/// Takes part in a team: finds other robots and stations, agrees with them on group and leader, shares what is seen.
#[interface(class = "team", crate = crate::macro_support)]
pub trait Team {
    /// Makes up an intruder at a place of the team's map. Only `end_fake` of the same module ends it.
    #[command(16)]
    fn add_fake(&mut self, x_m: f64, y_m: f64) -> Result<TeamObjectId, TeamRefusal>;

    /// Ends an intruder that this module made up.
    #[command(17)]
    fn end_fake(&mut self, id: TeamObjectId) -> Result<(), TeamRefusal>;

    /// The team, each beat.
    #[data(1)]
    fn state() -> TeamState;
}
