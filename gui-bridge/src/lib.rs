//! Draws a robot in Rerun: the world from above, what its modules are doing, what they say, and how packages flow.
//!
//! ```text
//!   packages ──▶ Bridge ──▶ View ──▶ Scene ──▶ Store ──▶ Feeder ──▶ Rerun ──▶ a file, or a Line to a viewer
//!   (a module's thread, which waits for nobody)      │   (a thread of its own, watched and cut off by the Pen)
//! ```
//!
//! A [`View`] says what is drawn of modules of a class; [`run_with`] makes a bridge with views of one's own. A
//! [`Scene`] knows nothing of mailboxes: the receiver of packages calls one of its methods for each. This is the only
//! crate that knows Rerun.
//!
//! Rerun waits for its sink without end. So the module's thread only fills the store (one pending row for each
//! entity, the newest wins), and the feeder alone calls Rerun. When a viewer stands still, its connection is cut: the
//! call fails, Rerun's threads end, its memory is free. Each new stream gets the last value of everything from the
//! store.
//!
//! **Invariants:** nothing that a viewer or a disk does makes the module's thread wait, also when it is switched on
//! or off: files are made and ended by the pen's threads. At its end alone the process waits for the end of the
//! drawing, for some seconds. And the bridge holds a bounded amount however long it runs: what the store holds, one
//! stream of Rerun's, and, while a drawing that was switched off does not end, that one's store.
#![forbid(unsafe_code)]

mod asking;
mod beyond;
mod blueprint;
mod bridge;
mod charts;
mod feeder;
mod files;
pub mod generic;
mod line;
mod network;
mod nodes;
mod palette;
mod pen;
mod scene;
mod sink;
mod slots;
mod states;
mod store;
mod subjects;
mod trail;
mod view;
mod views;
mod world;

pub use blueprint::{Layout, Tab};
pub use bridge::{Bridge, Drawing, DrawingInterface, DrawingProxy};
/// The version of Rerun that the bridge is made with: archetypes for [`Scene::log`], and blueprints for [`Tab::own`].
pub use rerun;
pub use scene::{DrawError, RATE_HZ, RATE_HZ_MIN, Scene, entity};
pub use sink::{CloseError, OpenError, Sink};
pub use states::Level;
pub use store::{BYTES_MAX, DrawingCounts, ENTITIES_MAX, LINE_BYTES_MAX, LINES_MAX};
pub use view::{Datum, View, Views, Wish};
pub use world::{MAP_CELLS_MAX, TILES_MAX};

/// Runs a bridge with views of one's own, which are asked before those that are built in: the whole of its `main`.
pub fn run_with<V: Views>() -> std::process::ExitCode {
    rohrpost::run::<Bridge<V>>()
}

#[cfg(test)]
mod testing;
