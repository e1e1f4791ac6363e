//! What the demonstration's modules compute: a simulated robot and its world, a real robot's log, a map, a way to
//! drive.
//!
//! ```text
//! world ──▶ simulator ──scan──▶ pilot ──twist──▶ simulator
//!               └─odometry──▶ track ──pose──┐
//! carmen ────────────────scan──────────────▶ grid ──▶ tiles of a map
//! ```
//!
//! Logic alone: nothing here sends a package, reads a clock or starts a thread; time is an argument. Modules wrap it.

mod angle;
pub mod carmen;
pub mod grid;
pub mod pilot;
pub mod playback;
pub mod simulator;
pub mod track;
mod traverse;
pub mod world;

pub use angle::wrap_rad;
