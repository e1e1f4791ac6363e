//! Networks of up to 64 simulated computers, from a seed, in virtual time: the same cores as under real sockets.
//!
//! ```text
//!  Plan (from the seed) ─▶ World: events ─▶ Station: clocks, mailboxes, modules ─▶ Router: one Layer for each port
//!                            │ Link: loss, delay, copies…   │ Calls: at most once               packages │ time │ …
//!                            └──────────────▶ Oracle: every package, every broken Promise ◀──────────────────────┘
//! ```
//!
//! A new protocol comes as one more [`station::Layer`]; what must hold of it as one more [`promise::Promise`].

pub mod calls;
pub mod chance;
pub mod clock;
pub mod declared;
pub mod divided;
mod edited;
pub mod events;
pub mod fault;
mod faults;
pub mod host;
pub mod link;
pub mod lives;
mod modules;
pub mod oracle;
pub mod package;
pub mod packages;
pub mod plan;
pub mod promise;
mod rare;
pub mod receiving;
pub mod replicas;
mod rough;
pub mod run;
mod seals;
pub mod sending;
pub mod slots;
pub mod slotted;
pub mod spans;
pub mod station;
mod table;
pub mod ticking;
pub mod times;
pub mod trace;
pub mod transmission;
mod unsteady;
pub mod wire;
pub mod world;
