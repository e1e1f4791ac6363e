//! Standard data that modules exchange: what a quantity is, its unit and its frame stand with each field.
//!
//! Frames are right-handed: x forward (or east), y left (or north), angles counter-clockwise from x. Where a type says
//! nothing else, lengths are metres, angles radians, times seconds.

mod geometry;
mod grid;
mod scan;

pub use geometry::{Odometry, Pose, Twist};
pub use grid::{Cell, OccupancyGrid};
pub use scan::LaserScan;
