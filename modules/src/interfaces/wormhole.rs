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

/// How it stands with the motor.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ControlState {
    /// The driver's control.
    pub mode: ControlMode,
    /// The source of the promises that count.
    pub driver: ControlDriver,
    /// Whether the last scan can be believed.
    pub sees: bool,
    /// Modules that hold the robot by `halt`.
    pub halted_by: Vec<String>,
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

    /// Stops the robot until the caller's `resume`, or anybody's `resume_all`. `number` is the caller's own, one for
    /// each halt.
    #[command(17)]
    fn halt(&mut self, number: u32) -> Result<(), ControlRefusal>;

    /// Lets go the halts of the caller; those that still hold the robot.
    #[command(18)]
    fn resume(&mut self) -> Vec<String>;

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

    /// How it stands, whenever mode, driver, sight or halts change.
    #[data(1)]
    fn control() -> ControlState;
}
