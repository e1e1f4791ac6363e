//! Three nodes that send in time slots, and an outside view of them.
//!
//! ```text
//!  n0: feeder ─▶ router ═══╗            ╔═══ flooder ┐
//!  n1: feeder ─▶ router ═══╬═══ bridge ═╣            │ bystanders: the load, with work on all processors
//!  n2: feeder ─▶ router ═══╝      │     ╚═══ swamp ◀─┘
//!                                 └─▶ capture: the kernel's stamp of each frame of a router
//! ```
//! All have this computer's clock, so a stamp of the capture and the master's time page show how long after the
//! beginning of its slot a frame really came. Routers are the real ones ([`routers`]); where clocks must be wrong, they
//! are threads of a child process ([`shells`]).

pub mod bare;
pub mod capture;
pub mod counts;
pub mod filter;
pub mod kept;
pub mod plan;
pub mod records;
pub mod rights;
pub mod routers;
pub mod shells;
pub mod stage;
pub mod takeover;
pub mod talkers;
pub mod traffic;
