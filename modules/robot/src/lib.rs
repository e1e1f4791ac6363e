//! What the demonstration's modules compute: a simulated robot and its world, a real robot's log, a map, a way to
//! drive.
//!
//! ```text
//! world ──▶ simulator ──scan──▶ pilot ──twist──▶ simulator ──▶ arena, which tells touches
//!               ├─odometry──▶ fusion ──pose──┐
//! carmen ───────│────────scan─────────────▶ grid ──▶ tiles of a map
//!               └─pose──▶ camera, depth ──▶ picture, points
//! ```
//!
//! Logic alone: nothing here sends a package, reads a clock or starts a thread; time is an argument. Modules wrap it.

#![forbid(unsafe_code)]

pub mod arena;
pub mod camera;
pub mod carmen;
pub mod depth;
pub mod grid;
pub mod lookout;
pub mod pilot;
pub mod pinhole;
pub mod playback;
pub mod sight;
pub mod simulator;
pub mod surroundings;
mod traverse;
pub mod world;
