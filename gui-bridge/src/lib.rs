//! Draws a robot in Rerun: the world from above, what its modules are doing, what they say, and how packages flow.
//!
//! ```text
//!   packages ──▶ Bridge ──▶ View ──▶ Scene ──▶ Store ──▶ Feeder ──▶ Rerun ──▶ a file, or a ViewerProxy
//!   records  ──▶ (a module's thread, never waits)    │   (a separate thread; the StreamSupervisor can stop it)
//! ```
//!
//! Records are those of large streams, pictures say, and of replicas: they are too large for packages, or are here
//! already, and are read where they lie. Each is copied into the store and released at once.
//!
//! A [`View`] says what is drawn of modules of a class; [`run_with`] makes a bridge with views of one's own. A
//! [`Scene`] does not use mailboxes: its caller receives packages and calls one method for each. Only this crate uses
//! Rerun.
//!
//! Rerun waits for its sink without end. So the module's thread only fills the store (one pending row for each
//! entity, the newest wins), and the feeder alone calls Rerun. When a viewer stands still, its connection is cut: the
//! call fails, Rerun's threads end, its memory is free. Each new stream gets the last value of everything from the
//! store.
//!
//! **Invariants:** a viewer or a disk never makes the module's thread wait, not even when drawing is switched on or
//! off: the supervisors' threads create and finish files. Only at its end the process waits some seconds for the
//! drawing to finish. Memory is bounded: the store, one Rerun stream, and the store of a drawing that was switched off
//! but has not ended.
#![forbid(unsafe_code)]

mod blueprint;
mod bridge;
mod charts;
mod error;
mod feeder;
mod files;
pub mod generic;
mod network;
mod nodes;
mod palette;
mod pictures;
mod points;
mod replicas;
mod ring;
mod scene;
mod sink;
mod slots;
mod state;
mod states;
mod store;
mod subjects;
mod supervisor;
mod tcp_links;
mod team;
mod timelines;
mod trajectory;
mod view;
mod viewer_proxy;
mod views;
mod world;

pub use blueprint::{Layout, Tab};
pub use bridge::{Bridge, Drawing, DrawingInterface, DrawingProxy};
pub use error::{DrawError, LARGE_BYTES_MAX, TILES_MAX};
/// The version of Rerun that the bridge is made with: archetypes for [`Scene::log`], and blueprints for [`Tab::own`].
pub use rerun;
pub use scene::{RATE_HZ, RATE_HZ_MIN, Scene, entity};
pub use sink::{CloseError, OpenError, Sink};
pub use states::Level;
pub use store::{BYTES_MAX, DrawingCounts, ENTITIES_MAX, LINE_BYTES_MAX, LINES_MAX};
pub use view::{Datum, View, Views, Wish};
pub use world::MAP_CELLS_MAX;

/// Runs a bridge with views of one's own, which are asked before those that are built in: the whole of its `main`.
pub fn run_with<V: Views>() -> std::process::ExitCode {
    rohrpost::run::<Bridge<V>>()
}

#[cfg(test)]
mod testing;
