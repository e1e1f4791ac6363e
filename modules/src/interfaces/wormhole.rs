//! What stands between a robot's programs and its motor, seen by tools, people's controls, and programs that promise
//! themselves.

use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// The driver's control of the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum ControlMode {
    /// Nobody: the driver has not promised since control was lost. The robot brakes.
    #[default]
    Disabled,
    /// Nobody yet: the driver has promised once, and is to keep that. The robot brakes.
    Test,
    /// The driver, within the envelope.
    Active,
    /// Nobody, until `reset`: the program has failed too often. The robot brakes.
    Failed,
}

/// The source of the promises that count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum ControlDriver {
    /// The robot's program.
    #[default]
    Program,
    /// The module that has taken over.
    Person,
}

/// How often something happened.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct CauseCount {
    /// What, in words.
    pub cause: String,
    /// How often, since the wormhole began.
    pub count: u64,
}

/// A halt that holds the robot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct HeldHalt {
    /// A module, or a person as `NAME@COMPUTER`.
    pub holder: String,
    /// The holder's own number of it.
    pub number: u32,
}

/// A place in the plane, in the frame of the robot's odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Destination {
    /// Metres along x.
    #[schema(unit = "m")]
    pub x_m: f64,
    /// Metres along y.
    #[schema(unit = "m")]
    pub y_m: f64,
}

/// How it stands with the motor.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ControlState {
    /// The driver's control.
    pub mode: ControlMode,
    /// The source of the promises that count.
    pub driver: ControlDriver,
    /// The module that makes them.
    pub driven_by: String,
    /// Whether the last scan can be believed.
    pub sees: bool,
    /// What holds the robot, until each is let go by `resume`.
    pub halts: Vec<HeldHalt>,
    /// Whether it is held without a name, too: until `resume_all`.
    pub held_unnamed: bool,
    /// Whether the wormhole itself drives, to the program's last destination.
    pub drives_itself: bool,
    /// Deadlines missed since control was gained last.
    pub failures: u32,
    /// Restarts of the program that were asked for.
    pub restarts: u64,
    /// How often the driver was given control, and lost it.
    pub gained: u64,
    /// See `gained`.
    pub lost: u64,
    /// Looks at the command in effect that came later than configured.
    pub late_looks: u64,
    /// Commands in effect, by each look.
    pub checked: u64,
    /// Promises that were refused, and commands that were capped or refused; causes that never happened are left out.
    pub causes: Vec<CauseCount>,
}

/// Why a call was refused, in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
#[error("{0}")]
pub struct ControlRefusal(pub String);

/// Lets commands through to the motor: in time, and within what the robot sees free. What people call, the supervised
/// program may not: `resume_all`, `take_over`, `give_back`, `reset`.
///
/// Programs that know `Motor` alone command it under the motor's name: each `drive` is a promise of a configured
/// length.
#[interface(class = "wormhole", crate = crate::macro_support)]
pub trait Supervisor {
    /// Promises this motion (m/s forward, rad/s counter-clockwise) for so long, ms, and the next promise before that.
    #[command(16)]
    fn promise(&mut self, duration_ms: u32, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), ControlRefusal>;

    /// Stops the robot until `resume` of the same number and holder, or anybody's `resume_all`. `holder`: a person, as
    /// `NAME@COMPUTER`; empty: the calling module. `number` is the holder's own, one for each halt; a repetition is no
    /// second halt.
    #[command(17)]
    fn halt(&mut self, number: u32, holder: String) -> Result<(), ControlRefusal>;

    /// Lets go one halt; those that still hold the robot.
    #[command(18)]
    fn resume(&mut self, number: u32, holder: String) -> Result<Vec<HeldHalt>, ControlRefusal>;

    /// Lets go the halts of all.
    #[command(19)]
    fn resume_all(&mut self) -> Result<(), ControlRefusal>;

    /// From now on the caller's promises count, and no others, until `give_back`.
    #[command(20)]
    fn take_over(&mut self) -> Result<(), ControlRefusal>;

    /// From now on those of the robot's program count again.
    #[command(21)]
    fn give_back(&mut self) -> Result<(), ControlRefusal>;

    /// A person has looked why the program failed: it may try again.
    #[command(22)]
    fn reset(&mut self) -> Result<(), ControlRefusal>;

    /// How it stands.
    #[command(23, idempotent)]
    fn state(&mut self) -> ControlState;

    /// Names the program's destination, which the wormhole drives to when the program has missed a deadline, if it is
    /// configured so (`safety = "greedy"`); none: there it halts. Only the program may.
    #[command(24)]
    fn set_destination(&mut self, destination: Option<Destination>) -> Result<(), ControlRefusal>;

    /// How it stands, whenever mode, driver, sight or halts change, or the wormhole begins or ends to drive itself.
    #[data(1)]
    fn control() -> ControlState;
}
