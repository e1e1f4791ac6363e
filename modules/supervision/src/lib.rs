//! Supervised control: what stands between a robot's programs and its motor (seed 000, 2.1, 3.1.1 and 4.1; digest,
//! section 1).
//!
//! ```text
//!  program ── promise: command, valid for so long ──▶ Wormhole ── command in effect ──▶ Envelope ──▶ motor
//!                                                     deadline, mode, halts             scan, brakes
//! ```
//!
//! - [`Wormhole`] checks *time*: a program has control as long as it keeps its own promises. Of a missed one, the robot
//!   brakes; a program that fails again and again is to be restarted, then kept off until a person has looked.
//! - [`Envelope`] checks *values*: a command passes only if the robot can still stop inside what its scanner saw free.
//!   What a lower speed makes safe is capped.
//! - [`Sight`] says whether a scan may be believed: new, young and not frozen.
//! - [`Walls`]: points of a scan that a map knows, and that do not come nearer as a person might.
//! - [`Safety`] drives when the program has missed its deadline: straight to its last destination, for a while.
//! - [`Halts`]: callers that have stopped the robot, until each of them lets it go.
//!
//! A module that may run on one of several computers runs on one at a time: [`lease`].
//!
//! Time is an argument: nanoseconds of a monotonic clock, any origin. Nothing here allocates, waits or reads a clock:
//! the same code runs in the module `wormhole`, in simulations, and on a microcontroller.
//!
//! The promise is *passive orientation safety* (Mitsch and others, International Journal of Robotics Research 2017,
//! arXiv 1605.00604): the robot does not move towards a point of contact that its scanner could see. What is not
//! promised: a sensor that lies, brakes that fail, what runs into a standing robot.

#![no_std]
#![forbid(unsafe_code)]

mod command;
mod envelope;
mod halts;
pub mod lease;
mod limits;
mod motion;
mod promise;
mod safety;
mod sector;
mod sight;
mod walls;
mod way;
mod window;
mod wormhole;

pub use command::Command;
pub use envelope::{Capped, Envelope, Mounting, Verdict, Why};
pub use halts::{HaltId, Halts, TooManyHalts};
pub use limits::Limits;
pub use motion::{Bounds, Motion};
pub use promise::{Order, Promise, Refusal};
pub use safety::{Located, Place, Safety};
pub use sight::{NoSight, Scan, Sight};
pub use walls::{MapPose, Walls};
pub use wormhole::{Change, Control, Driver, Missed, Mode, Settings, Wormhole};
