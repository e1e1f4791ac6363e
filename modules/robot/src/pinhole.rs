//! A pinhole that looks level into the world: which ray belongs to a pixel, and where the ray ends.
//!
//! ```text
//!      z up                 columns from left to right, rows from top to bottom, square pixels
//!      │   x forward        focal_px = (width_px / 2) / tan(field_of_view_rad / 2)
//!      │  ╱                 ray of a pixel: (1, left, up), where
//! y ───┘                      left = (width_px / 2 - column - 0.5) / focal_px
//! left                        up = (height_px / 2 - row - 0.5) / focal_px
//! ```
//!
//! The depth of what a pixel sees is its x. Walls stand upright, so all pixels of a column that see a wall see it at
//! one depth; floor and ceiling are level, so all pixels of a row that see one of these see it at one depth. The nearer
//! of the two is what the pixel sees.

use super::sight::WallSide;
use super::world::World;
use rohrpost_modules::types::Pose;

/// Height of all rooms: the map says where walls stand, and not how high they are.
pub const CEILING_M: f64 = 2.5;

/// How a camera looks into the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Angle from the left edge of the picture to the right one, less than half a turn.
    pub field_of_view_rad: f64,
    /// What is deeper is not seen.
    pub depth_max_m: f64,
    /// Where it is mounted, in the robot's frame.
    pub mounting: Pose,
    /// Height above the floor, less than [`CEILING_M`].
    pub height_m: f64,
}

impl Pinhole {
    /// Pixels.
    pub fn pixels(&self) -> usize {
        self.width_px as usize * self.height_px as usize
    }

    /// Distance from the pinhole to the picture, in pixels.
    pub fn focal_px(&self) -> f64 {
        0.5 * f64::from(self.width_px) / (0.5 * self.field_of_view_rad).tan()
    }

    /// How far to the left a column's rays go for each metre forward.
    pub fn left(&self, column: u32) -> f64 {
        (0.5 * f64::from(self.width_px) - f64::from(column) - 0.5) / self.focal_px()
    }

    /// How far up a row's rays go for each metre forward.
    pub fn up(&self, row: u32) -> f64 {
        (0.5 * f64::from(self.height_px) - f64::from(row) - 0.5) / self.focal_px()
    }

    /// Depth at which a row's rays meet the floor or the ceiling; infinite for a level row.
    pub fn level_depth_m(&self, row: u32) -> f64 {
        let up = self.up(row);
        if up < 0.0 { self.height_m / -up } else { (CEILING_M - self.height_m) / up }
    }
}

/// What one column of a picture sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Column {
    /// Metres to the left for each metre forward.
    pub(super) left: f32,
    /// Depth of the wall; infinite if there is none within the range.
    pub(super) depth_m: f32,
    /// Side of the wall.
    pub(super) side: WallSide,
}

/// The walls that a pinhole sees. Its memory is allocated once.
pub(super) struct Walls {
    pinhole: Pinhole,
    columns: Vec<Column>,
}

impl Walls {
    /// Nothing seen yet.
    pub(super) fn new(pinhole: Pinhole) -> Self {
        let column =
            |column| Column { left: pinhole.left(column) as f32, depth_m: f32::INFINITY, side: WallSide::default() };
        Self { pinhole, columns: (0..pinhole.width_px).map(column).collect() }
    }

    /// Looks from a robot that stands here: one ray for each column. Returns where the pinhole is.
    pub(super) fn look(&mut self, world: &World, robot: &Pose) -> Pose {
        let eye = Pose::from(robot.isometry() * self.pinhole.mounting.isometry());
        for column in &mut self.columns {
            let left = f64::from(column.left);
            // Metres along the ray for each metre of depth.
            let stretch = left.hypot(1.0);
            let direction_rad = eye.heading_rad + left.atan();
            let seen = world.look(eye.x_m, eye.y_m, direction_rad, self.pinhole.depth_max_m * stretch);
            (column.depth_m, column.side) = seen
                .map_or((f32::INFINITY, WallSide::default()), |seen| ((seen.distance_m / stretch) as f32, seen.side));
        }
        eye
    }

    /// What was seen, from left to right.
    pub(super) fn columns(&self) -> &[Column] {
        &self.columns
    }
}

#[cfg(test)]
#[path = "pinhole_tests.rs"]
pub(super) mod tests;
