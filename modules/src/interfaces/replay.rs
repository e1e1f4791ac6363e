//! A recording that is played, seen by tools.

use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// Where a replay is, and what it has done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ReplayPosition {
    /// After the recording's begin.
    #[schema(unit = "s")]
    pub at_s: f64,
    /// From its begin to its end.
    #[schema(unit = "s")]
    pub length_s: f64,
    /// The node's time, since 1970; 0 before the begin.
    #[schema(unit = "ns")]
    pub time_ns: u64,
    /// Of the node's time.
    pub epoch: u64,
    /// Times the speed at which it was recorded.
    pub rate: f64,
    /// Time stands still.
    pub paused: bool,
    /// There is nothing more to play.
    pub ended: bool,
    /// Times that it began anew, with `--loop`.
    pub rounds: u32,
    /// Values played.
    #[schema(unit = "messages")]
    pub played: u64,
    /// Besides, values from before the place where it began, or was sought: the newest one of each channel.
    #[schema(unit = "messages")]
    pub older: u64,
    /// Channels that they were of.
    pub channels: u32,
    /// Values that their stream did not take: too large, or too late.
    #[schema(unit = "messages")]
    pub refused: u64,
    /// Places in files that could not be read.
    pub damages: u64,
    /// Half of the values came no further from their recorded distance to the one before.
    #[schema(unit = "ns")]
    pub spacing_p50_ns: Option<u64>,
    /// 99 of 100 of them.
    #[schema(unit = "ns")]
    pub spacing_p99_ns: Option<u64>,
    /// All of them.
    #[schema(unit = "ns")]
    pub spacing_max_ns: Option<u64>,
    /// The same without the time for which the player waited for a processor that others had: half of the values,
    #[schema(unit = "ns")]
    pub spacing_own_p50_ns: Option<u64>,
    /// 99 of 100 of them,
    #[schema(unit = "ns")]
    pub spacing_own_p99_ns: Option<u64>,
    /// all of them.
    #[schema(unit = "ns")]
    pub spacing_own_max_ns: Option<u64>,
}

/// Why a replay does not do what it is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum ReplayRefusal {
    /// Time does not go back, and no faster.
    #[error("the rate {0} is not above 0 and at most 1000; `pause` lets time stand still")]
    Rate(f64),
    /// A time outside of the recording.
    #[error("{at_s} s is no time of the recording, which has {length_s} s from its begin on")]
    Time {
        /// What was asked for.
        at_s: f64,
        /// Length of the recording.
        length_s: f64,
    },
    /// A step of no length.
    #[error("a step by {0} s; write a time above 0")]
    Step(f64),
    /// The file.
    #[error("{0}")]
    File(String),
}

/// Plays a recording in the place of the modules that were recorded; its time is the node's.
#[interface(class = "replay", crate = crate::macro_support)]
pub trait Replay {
    /// Where it is.
    #[command(16, idempotent)]
    fn position(&mut self) -> ReplayPosition;

    /// Lets the node's time stand still.
    #[command(17, idempotent)]
    fn pause(&mut self);

    /// Goes on.
    #[command(18, idempotent)]
    fn resume(&mut self);

    /// Goes on at so many times the recorded speed.
    #[command(19, idempotent)]
    fn rate(&mut self, rate: f64) -> Result<(), ReplayRefusal>;

    /// Pauses, and plays the next value; time goes on to its arrival.
    #[command(20)]
    fn step(&mut self);

    /// Pauses, and plays all values of the next so many seconds.
    #[command(21)]
    fn step_by(&mut self, seconds: f64) -> Result<(), ReplayRefusal>;

    /// Goes to what arrived so many seconds after the recording's begin, or next behind that; with an epoch of its own.
    /// The newest value of each channel from before is played first, with its stamp.
    #[command(22, idempotent)]
    fn seek(&mut self, seconds: f64) -> Result<(), ReplayRefusal>;

    /// Where it is, several times a second while that changes.
    #[data(1)]
    fn state() -> ReplayPosition;
}
