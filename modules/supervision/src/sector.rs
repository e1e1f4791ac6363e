//! Where the centre of a robot may be until it stands, and what a disc touches there.

use core::f64::consts::FRAC_1_SQRT_2;
use libm::{fabs, sincos, sqrt};

/// A direction, as its unit vector.
#[derive(Clone, Copy)]
pub(crate) struct Direction {
    pub(crate) x: f64,
    pub(crate) y: f64,
}

impl Direction {
    pub(crate) fn of(angle_rad: f64) -> Self {
        let (y, x) = sincos(angle_rad);
        Self { x, y }
    }

    pub(crate) fn turned(self, by: Self) -> Self {
        Self { x: self.x * by.x - self.y * by.y, y: self.y * by.x + self.x * by.y }
    }
}

/// The directions in which the robot's centre may leave where it was, from `right` counter-clockwise to `left`.
pub(crate) struct Sector {
    pub(crate) right: Direction,
    pub(crate) left: Direction,
    /// Wider than half a turn: everything is inside.
    pub(crate) is_wide: bool,
}

impl Sector {
    /// Whether a point lies in the sector's directions, or near to them.
    pub(crate) fn is_in_the_way(&self, x_m: f64, y_m: f64) -> bool {
        let near_m = IN_THE_WAY_COS * sqrt(x_m * x_m + y_m * y_m);
        let is_near = |edge: &Direction| edge.x * x_m + edge.y * y_m > near_m;
        is_near(&self.right) || is_near(&self.left) || self.contains(x_m, y_m)
    }

    pub(crate) fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let is_between = || {
            self.right.x * y_m - self.right.y * x_m >= 0.0
                && self.left.y * x_m - self.left.x * y_m >= 0.0
                // Of a sector without width, the first two hold behind it, too.
                && (self.right.x + self.left.x) * x_m + (self.right.y + self.left.y) * y_m > 0.0
        };
        self.is_wide || is_between()
    }

    /// The reach at which a disc of `radius_m` that moves in the sector touches a point; infinite if never.
    pub(crate) fn contact_m(&self, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
        if self.contains(x_m, y_m) {
            return (sqrt(x_m * x_m + y_m * y_m) - radius_m).max(0.0);
        }
        let along_edge = |edge: &Direction| {
            let (along_m, across_m) = (edge.x * x_m + edge.y * y_m, edge.x * y_m - edge.y * x_m);
            if along_m <= 0.0 || fabs(across_m) >= radius_m {
                return f64::INFINITY;
            }
            (along_m - sqrt(radius_m * radius_m - across_m * across_m)).max(0.0)
        };
        along_edge(&self.right).min(along_edge(&self.left))
    }
}

/// Directions so near to the sector lie in the way.
const IN_THE_WAY_COS: f64 = FRAC_1_SQRT_2;
