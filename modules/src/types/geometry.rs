//! Where a robot is and how it moves, in the plane.

use nalgebra::{Isometry2, Vector2};
use rohrpost_fusion::Interpolate;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// A place and a heading in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema, Interpolate)]
#[interpolate(crate = rohrpost_fusion)]
#[schema(name = "rohrpost.Pose")]
pub struct Pose {
    /// Metres along x.
    #[schema(unit = "m")]
    pub x_m: f64,
    /// Metres along y.
    #[schema(unit = "m")]
    pub y_m: f64,
    /// Radians, counter-clockwise from x; any multiple of a turn may be added.
    #[schema(unit = "rad")]
    #[interpolate(heading)]
    pub heading_rad: f64,
}

impl Pose {
    /// The pose as the rigid motion that takes points of the body's frame to the frame the pose is given in.
    pub fn isometry(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x_m, self.y_m), self.heading_rad)
    }
}

impl From<Isometry2<f64>> for Pose {
    fn from(motion: Isometry2<f64>) -> Self {
        Self { x_m: motion.translation.x, y_m: motion.translation.y, heading_rad: motion.rotation.angle() }
    }
}

/// How fast a body moves in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema, Interpolate)]
#[interpolate(crate = rohrpost_fusion)]
#[schema(name = "rohrpost.Twist")]
pub struct Twist {
    /// Metres a second, forward.
    #[schema(unit = "m/s")]
    pub speed_m_s: f64,
    /// Radians a second, counter-clockwise.
    #[schema(unit = "rad/s")]
    pub turn_rate_rad_s: f64,
}

/// What a base says of its own motion: counted from where it started, and drifting.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema, Interpolate)]
#[interpolate(crate = rohrpost_fusion)]
#[schema(name = "rohrpost.Odometry")]
pub struct Odometry {
    /// Where the base believes to be, in the frame in which it started.
    pub pose: Pose,
    /// How it moves now.
    pub twist: Twist,
}
