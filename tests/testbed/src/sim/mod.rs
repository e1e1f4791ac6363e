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
mod divided;
mod edited;
pub mod events;
mod fault;
mod faults;
mod host;
mod launches;
mod lease_plan;
mod leased;
mod leases;
pub mod link;
mod lives;
mod modules;
mod oracle;
mod package;
mod packages;
pub mod plan;
pub mod promise;
pub mod radio;
mod rare;
mod receiving;
mod replicas;
mod rough;
pub mod run;
mod seals;
mod sending;
mod slots;
mod slotted;
mod spans;
mod station;
mod table;
pub mod team_end;
mod ticking;
mod times;
mod trace;
mod transmission;
mod unsteady;
mod wire;
mod world;
