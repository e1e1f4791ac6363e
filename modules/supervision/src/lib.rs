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
//! - [`Halts`]: callers that have stopped the robot, until each of them lets it go.
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
mod limits;
mod motion;
mod promise;
mod sector;
mod sight;
mod way;
mod window;
mod wormhole;

pub use command::Command;
pub use envelope::{Capped, Envelope, Mounting, Verdict, Why};
pub use halts::{HaltId, Halts, TooManyHalts};
pub use limits::Limits;
pub use motion::{Bounds, Motion};
pub use promise::{Order, Promise, Refusal};
pub use sight::{NoSight, Scan, Sight};
pub use wormhole::{Change, Control, Driver, Mode, Settings, Wormhole};
