//! A world of many robots: a map, robots that drive, intruders that flee, and a referee (seed 000, 4.1.1 and 5.1).
//!
//! ```text
//!  motor of robot 3 ──drive──▶┌─ Arena ──────────────────────────────┐──scan, pose──▶ sensors of robot 3
//!  motor of robot 4 ──drive──▶│ each 10 ms: intruders, robots by id  │──scan, pose──▶ sensors of robot 4
//!                             │   └─▶ Referee: touches, cells, swaps │──▶ Incident: when, what, by which robot
//!                             └──────────────────────────────────────┘
//! ```
//!
//! - [`Arena`] moves all bodies. A robot has the dynamics of [`rohrpost_robot::simulator`]. It touches walls,
//!   robots and intruders, and its scanner sees them.
//! - [`Conduct`] says how an intruder behaves: it stands, follows a script, or flees.
//! - [`Referee`] notes what robots must not do. Nothing that a robot does stops it.
//!
//! Time is an argument, and all chance comes from a seed: the same calls give the same bits.

#![forbid(unsafe_code)]

mod arena;
mod entrances;
mod intruder;
mod referee;

pub use arena::{Arena, ArenaSettings, NoArena, NoRobot};
pub use intruder::Conduct;
pub use referee::{Incident, Mishap, Referee, Thing};
