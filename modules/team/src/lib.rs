//! What robots of a team know of each other and of the world, and how they plan on a map (seed 000, 2.3, 2.4, 3.2, 3.3
//! and 4.4; digest, sections 3 to 6).
//!
//! ```text
//!            ┌─────────────────────────── Team ───────────────────────────┐
//!  beat ────▶│ group: counters ──▶ fresh robots ──▶ leader, group          │──▶ Hello: counters, digests, clock
//!  Hello ───▶│ time:  exchange ──▶ offsets with bounds                     │──▶ Records: new ones; a synchro
//!  Records ─▶│ view:  records of observers ──▶ objects, `certain`          │
//!  look ────▶└────────────────────────────────────────────────────────────┘
//! ```
//!
//! - [`group`]: which robots are alive, and which leads. Each robot computes it from counters that it has heard of. The
//!   seed copies leader and group from messages instead, which does not converge (digest, 5.1): its algorithm stands
//!   in the tests, as the variant that fails.
//! - [`view`]: what the robots have seen. Records are joined without a clock; digests in hellos show what is missing.
//! - [`time`]: how the clocks of others differ, with bounds, for people and for what is written down.
//! - [`Team`] has the three, and says what to send.
//! - [`events`]: a tree of groups and leaves, by which a payload reacts to events of its robot and of teammates.
//! - [`coordination`]: which robot holds which exit of an intruder, ways for all robots, and claims on cells.
//! - [`grid`]: maps of cells, and the shortest path between two of them around other robots.
//!
//! Nothing here has a mailbox, a socket, a thread, a clock or chance. The cores can be cloned, compared and hashed, so
//! that simulations and model checkers can run them. Memory is bounded: 254 robots, [`view::RECORDS_MAX`] records each.
//!
//! **What is not promised.** A robot that is only heard through others has no known place, so an obstacle may be taken
//! for an intruder though it is that robot. Robots believe what teammates send: messages are checked against mistakes,
//! not against malice; the transport has to authenticate.

#![forbid(unsafe_code)]

mod bytes;
pub mod coordination;
pub mod events;
pub mod grid;
pub mod group;
mod ids;
mod team;
pub mod time;
pub mod view;

pub use bytes::Malformed;
pub use ids::{Position, RobotId, Run, Version};
pub use team::{Beat, Suspicion, Team, TeamSettings};

// The book's code is compiled and run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/src/teams.md")]
mod book {}
