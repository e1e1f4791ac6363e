//! What a range scanner sees.

use super::Pose;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// One sweep of a range scanner. Beam `i` points to `start_rad + i * step_rad` in the scanner's frame (x forward).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.LaserScan")]
pub struct LaserScan {
    /// Direction of the first beam, radians.
    #[schema(unit = "rad")]
    pub start_rad: f32,
    /// Angle from one beam to the next, radians; negative when the scanner turns clockwise.
    #[schema(unit = "rad")]
    pub step_rad: f32,
    /// Readings of this length and more mean that nothing came back, metres.
    #[schema(unit = "m")]
    pub range_max_m: f32,
    /// Distances in the order of the beams, metres. Not a number: no reading.
    #[schema(unit = "m")]
    pub ranges_m: Vec<f32>,
    /// Where the scanner stood, if its source knows better than odometry (a log that was corrected afterwards).
    pub pose: Option<Pose>,
}

impl LaserScan {
    /// Direction of beam `index` in the scanner's frame, radians.
    pub fn angle_rad(&self, index: usize) -> f64 {
        f64::from(self.start_rad) + index as f64 * f64::from(self.step_rad)
    }

    /// The beams that hit something: direction in radians and distance in metres.
    pub fn hits(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let hit = |range: f32| range > 0.0 && range < self.range_max_m;
        let beams = self.ranges_m.iter().enumerate().filter(move |(_, range)| hit(**range));
        beams.map(|(index, range)| (self.angle_rad(index), f64::from(*range)))
    }
}
