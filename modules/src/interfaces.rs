//! Interfaces behind which hardware, simulation and logs are interchangeable (seed 002, 5.2), and those of the built-in
//! modules.

mod arena;
mod payload;
mod recorder;
mod replay;
mod router;
mod slots;
mod station;
mod tcp;
mod team;
mod team_router;
mod wormhole;

pub use arena::{
    Arena, ArenaConduct, ArenaCounts, ArenaIncident, ArenaInterface, ArenaIntruder, ArenaMishap, ArenaProxy,
    ArenaRefusal, ArenaRobot, ArenaState,
};
pub use payload::{
    Payload, PayloadBeats, PayloadExit, PayloadIdle, PayloadInterface, PayloadMode, PayloadProxy, PayloadState,
    TeamCell, TeamPlace,
};
pub use recorder::{ChannelPage, LostBy, RecordedMessages, Recorder, RecorderInterface, RecorderProxy, RecordingState};
pub use replay::{Replay, ReplayInterface, ReplayPosition, ReplayProxy, ReplayRefusal};
pub use router::{
    Age, Carried, CarriedLoss, ClassCarried, ClockRole, ClockState, FlowState, FlowStates, LevelWaiting, LinkCounters,
    LinkState, Links, NewEpochError, PeerLink, Rejected, ReplicaCause, ReplicaState, ReplicaStates, Router,
    RouterInterface, RouterProxy, SocketFailure,
};
pub use slots::{SlotState, SlotUse, TunnelState};
pub use station::{
    Station, StationAnswer, StationInterface, StationMessage, StationProxy, StationRequest, StationRequestKind,
    StationRobot, StationState,
};

pub use tcp::{
    BeyondClient, BeyondClients, BeyondCrowded, BeyondHost, BeyondHosts, BeyondLink, BeyondNode, BeyondOutage,
    BeyondState, BeyondStream, BeyondStreams, BeyondTime, ClassPassed, Tcp, TcpInterface, TcpProxy,
};

pub use team::{
    Team, TeamClock, TeamCounts, TeamInterface, TeamMember, TeamNotice, TeamNoticeKind, TeamObject, TeamObjectId,
    TeamProxy, TeamRefusal, TeamState,
};
pub use team_router::{TeamLinks, TeamNode, TeamRouter, TeamRouterInterface, TeamRouterProxy};

pub use wormhole::{
    CauseCount, ControlDriver, ControlMode, ControlRefusal, ControlState, Destination, HeldHalt, Supervisor,
    SupervisorInterface, SupervisorProxy,
};

use crate::interface;
use crate::output::OutputLine;
use crate::types::{Image, LaserScan, OccupancyGrid, Odometry, PointCloud, Pose, Twist};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why a motor does not drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum DriveError {
    /// A speed or rate that is not a number.
    #[error("speed and turn rate must be finite numbers")]
    NotFinite,
    /// The hardware does not answer.
    #[error("the motor does not obey: {0}")]
    Hardware(String),
}

/// Drives a robot in the plane.
#[interface(class = "motor", crate = crate::macro_support)]
pub trait Motor {
    /// Sets speed (m/s, forward) and turn rate (rad/s, counter-clockwise), within what the motor can do. It stops by
    /// itself when no command came for its dead-man time.
    #[command(16)]
    fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError>;

    /// Brakes to a standstill.
    #[command(17, idempotent)]
    fn halt(&mut self) -> Result<(), DriveError>;

    /// How the wheels turn now.
    #[data(1)]
    fn motion() -> Twist;
}

/// Sees with a range scanner.
#[interface(class = "laser", crate = crate::macro_support)]
pub trait Laser {
    /// One sweep.
    #[stream(1)]
    fn scan() -> LaserScan;
}

/// Tells how far the wheels have turned.
#[interface(class = "odometry", crate = crate::macro_support)]
pub trait Wheels {
    /// Where the base believes to be, and how it moves.
    #[stream(1)]
    fn odometry() -> Odometry;
}

/// Sees pictures.
#[interface(class = "camera", crate = crate::macro_support)]
pub trait Camera {
    /// What it sees.
    #[stream(1)]
    fn image() -> Image;
}

/// Sees how far away things are, in all of its picture.
#[interface(class = "depth", crate = crate::macro_support)]
pub trait Depth {
    /// The points that it sees, in its own frame.
    #[stream(1)]
    fn points() -> PointCloud;
}

/// What a map was made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct MapCounts {
    /// Scans that came in.
    pub scans: u64,
    /// Odometry that came in.
    pub odometries: u64,
    /// Scans that went into the map.
    pub mapped: u64,
    /// Scans without a known pose at their time.
    pub without_pose: u64,
    /// Cells seen free.
    pub free: u64,
    /// Cells seen occupied.
    pub occupied: u64,
}

/// Draws a map.
#[interface(class = "mapper", crate = crate::macro_support)]
pub trait Cartographer {
    /// What the map was made of so far.
    #[command(16, idempotent)]
    fn counts(&mut self) -> MapCounts;

    /// Publishes the whole map once more, for late subscribers.
    #[command(17, idempotent)]
    fn publish_all(&mut self);

    /// Forgets the map.
    #[command(18)]
    fn clear(&mut self);

    /// A patch of the map that has changed; it takes the place of the one with the same origin.
    #[data(1)]
    fn map() -> OccupancyGrid;

    /// Where the scanner stood when it saw the last scan that went into the map.
    #[data(2)]
    fn pose() -> Pose;
}

/// How far a log has been played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Progress {
    /// Scans published.
    pub scans: u64,
    /// Odometry published.
    pub odometries: u64,
    /// Records left out because their stamps are not to be believed.
    pub discarded: u64,
    /// Records that their stream did not take, as they are too far behind its newest.
    pub late: u64,
    /// Broken lines.
    pub malformed: u64,
    /// Lines of other kinds.
    pub skipped: u64,
    /// Time played, in seconds of the log.
    pub played_s: f64,
    /// Whether the log is at its end.
    pub finished: bool,
}

/// Plays a log.
#[interface(class = "player", crate = crate::macro_support)]
pub trait Player {
    /// How far it is.
    #[command(16, idempotent)]
    fn progress(&mut self) -> Progress;
}

/// A page of the collector's lines.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Page {
    /// Tells this incarnation of the collector from earlier ones; lines are counted from its start.
    pub life: u32,
    /// Number of the first line here.
    pub first: u64,
    /// Number of the next line that will be collected.
    pub next: u64,
    /// As many lines as fit in a reply, and follow each other: one that is no longer kept ends the page.
    pub lines: Vec<OutputLine>,
}

/// Lines that the collector did not take, or not as they were, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RefusedLines {
    /// From another system, or in the name of one of its modules.
    pub other_system: u64,
    /// In another name than the sender's. (Launch may pass on what modules of its node print.)
    pub foreign_name: u64,
    /// More than the sender's share.
    pub beyond_share: u64,
    /// No lines at all.
    pub unreadable: u64,
    /// Taken, but for their time, which lay in the future.
    pub ahead: u64,
    /// Taken, but for the number of lines that they said were lost or suppressed.
    pub losses: u64,
}

/// Collects what all modules say.
#[interface(class = "output", crate = crate::macro_support)]
pub trait Collector {
    /// The lines that are kept, from this number on, as many as fit.
    #[command(16, idempotent)]
    fn lines_from(&mut self, number: u64) -> Page;

    /// How many lines were not taken, and why.
    #[command(17, idempotent)]
    fn refused(&mut self) -> RefusedLines;

    /// Each line as it comes in.
    #[data(1)]
    fn line() -> OutputLine;
}
