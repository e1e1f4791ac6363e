//! What a robot can touch and see: the squares of its world, and discs that stand or move in it.

use crate::world::World;

/// Something round, such as another robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disc {
    /// Middle along x, metres.
    pub x_m: f64,
    /// Middle along y, metres.
    pub y_m: f64,
    /// From the middle to the rim, metres.
    pub radius_m: f64,
}

impl Disc {
    /// The point of its rim that is nearest to another disc's middle, metres; `None` if that disc does not reach it.
    pub fn contact(&self, x_m: f64, y_m: f64, radius_m: f64) -> Option<(f64, f64)> {
        let (ahead_m, aside_m) = (x_m - self.x_m, y_m - self.y_m);
        let apart_m = ahead_m.hypot(aside_m);
        let share = self.radius_m / apart_m.max(f64::MIN_POSITIVE);
        let rim = (self.x_m + ahead_m * share, self.y_m + aside_m * share);
        (apart_m < self.radius_m + radius_m).then_some(rim)
    }

    /// Distance to its rim along a ray, metres; 0 from inside. `None` if the ray misses it.
    pub fn cast(&self, x_m: f64, y_m: f64, direction_rad: f64) -> Option<f64> {
        let (sin, cos) = direction_rad.sin_cos();
        let (ahead_m, aside_m) = (self.x_m - x_m, self.y_m - y_m);
        let (along_m, across_m) = (ahead_m * cos + aside_m * sin, aside_m * cos - ahead_m * sin);
        let half_m2 = self.radius_m * self.radius_m - across_m * across_m;
        let ends_m = along_m + half_m2.max(0.0).sqrt();
        (half_m2 > 0.0 && ends_m > 0.0).then(|| (along_m - half_m2.sqrt()).max(0.0))
    }
}

/// A world with discs in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surroundings {
    pub(crate) world: World,
    pub(crate) discs: Vec<Disc>,
}

impl Surroundings {
    /// Where a disc reaches into a wall or another disc, metres.
    pub(crate) fn contact(&self, x_m: f64, y_m: f64, radius_m: f64) -> Option<(f64, f64)> {
        let disc = || self.discs.iter().find_map(|disc| disc.contact(x_m, y_m, radius_m));
        self.world.contact(x_m, y_m, radius_m).or_else(disc)
    }

    /// Distance to what a ray meets first, metres.
    pub(crate) fn cast(&self, x_m: f64, y_m: f64, direction_rad: f64, range_max_m: f64) -> Option<f64> {
        let wall = self.world.cast(x_m, y_m, direction_rad, range_max_m);
        let discs = self.discs.iter().filter_map(|disc| disc.cast(x_m, y_m, direction_rad));
        discs.filter(|distance_m| *distance_m <= range_max_m).chain(wall).min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_disc_is_seen_from_its_near_side_and_touched_at_its_rim() {
        let disc = Disc { x_m: 3.0, y_m: 1.0, radius_m: 0.5 };
        for (x_m, y_m, direction_rad, seen, why) in [
            (1.0, 1.0, 0.0, Some(1.5), "straight ahead"),
            (1.0, 1.0, PI, None, "behind"),
            (1.0, 1.6, 0.0, None, "beside"),
            (3.0, 0.0, FRAC_PI_2, Some(0.5), "from below"),
            (3.1, 1.0, 0.0, Some(0.0), "from inside"),
        ] {
            assert_eq!(disc.cast(x_m, y_m, direction_rad).map(|it| (it * 1e9).round() / 1e9), seen, "{why}");
        }
        assert_eq!(disc.contact(2.0, 1.0, 0.5), None, "it only touches");
        assert_eq!(disc.contact(2.1, 1.0, 0.5), Some((2.5, 1.0)));
        assert!(disc.contact(3.0, 1.0, 0.1).is_some_and(|(x_m, y_m)| x_m.is_finite() && y_m.is_finite()));
    }
}
