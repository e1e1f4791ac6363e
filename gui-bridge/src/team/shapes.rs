//! Shapes in space.

use rohrpost::types::Pose;
use std::f32::consts::TAU;

/// Corners of a ring.
const RING_CORNERS: u8 = 24;

/// A closed line around a place, at a height, m.
pub(super) fn ring([x, y]: [f32; 2], radius_m: f32, z_m: f32) -> Vec<[f32; 3]> {
    let corner = |corner: u8| (f32::from(corner) * TAU / f32::from(RING_CORNERS)).sin_cos();
    (0..=RING_CORNERS).map(corner).map(|(sin, cos)| [x + radius_m * cos, y + radius_m * sin, z_m]).collect()
}

/// A point above a place, m.
pub(super) fn at(pose: &Pose, z_m: f32) -> [f32; 3] {
    [pose.x_m as f32, pose.y_m as f32, z_m]
}
