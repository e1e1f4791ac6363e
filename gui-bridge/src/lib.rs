//! Draws a robot in Rerun: the world from above, what its modules are doing, what they say, and how packages flow.
//!
//! ```text
//!   packages ──▶ Bridge (a module) ──▶ Scene ──▶ Rerun's batcher thread ──▶ Sink: a file or a viewer
//!                                   world, states, charts, generic
//! ```
//!
//! A [`Scene`] knows nothing of mailboxes: who receives packages calls one of its methods for each. This is the only
//! crate that knows Rerun.
//!
//! **Invariant:** a scene remembers a bounded amount however long it runs. What it has drawn lives with the sink.
//!
//! Rerun pushes back: when the sink stands still and [`sink::BYTES_IN_FLIGHT`] are waiting, every drawing method blocks.
//! So a scene belongs in a process of its own, which subscribes to bounded mailboxes and may be killed at any time.
#![forbid(unsafe_code)]

mod blueprint;
mod bridge;
mod charts;
pub mod generic;
mod palette;
mod scene;
pub mod sink;
mod states;
mod trail;
mod world;

pub use bridge::Bridge;
pub use scene::{CloseError, DrawError, Scene};
pub use sink::{Connection, OpenError, Sink};
pub use states::Level;
pub use world::{MAP_CELLS_MAX, TILES_MAX};

#[cfg(test)]
mod testing;
