//! A team of robots in one process, in virtual time and from a seed, with the very cores of a robot: payload, wormhole,
//! envelope, team and team router. The arena stands in for floor and bodies, and referees.
//!
//! ```text
//!            ┌─ Robot, with a clock of its own ────────────┐
//!  Radio ──▶ │ TeamEnd ──▶ Payload ──▶ Guard: wormhole,    │ ──drive──▶ Arena ──▶ Referee
//!    ▲       │    │           ▲        envelope, safety    │              │
//!    └───────│◀───┘           └── pose, scan ──────────────│◀─────────────┘
//!            └─────────────────────────────────────────────┘
//! ```
//!
//! Equal seeds give equal runs. A mistake is told with the seed that repeats it.

#![forbid(unsafe_code)]

mod guard;
pub mod maps;
mod robot;
pub mod scenario;
pub mod scene;
pub mod standard;
mod watch;
pub mod world;
