//! What a ray meets in the world: how far away it is, and which side of a blocked square.

use super::traverse::Traversal;
use super::world::World;

/// A side of a blocked square: where it points to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WallSide {
    /// To larger x.
    East,
    /// To larger y.
    North,
    /// To smaller x.
    #[default]
    West,
    /// To smaller y.
    South,
    /// No side: the ray begins inside a wall, or is none.
    Inside,
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// From where the ray begins, metres.
    pub distance_m: f64,
    /// What it meets there.
    pub side: WallSide,
}

impl World {
    /// The first blocked square in this direction, exactly; none within `range_max_m`. At a distance of 0 inside a
    /// wall, and if a number is not finite.
    ///
    /// ```
    /// use rohrpost_robot::{sight::{Seen, WallSide}, world::World};
    /// let world = World::parse("rohrpost-map 1\ncell_m 0.5\nmap\n#####\n#> .#\n#####\n").unwrap();
    /// assert_eq!(world.look(0.75, 0.75, 0.0, 10.0), Some(Seen { distance_m: 1.25, side: WallSide::West }));
    /// assert_eq!(world.look(0.75, 0.75, 0.0, 1.0), None);
    /// ```
    pub fn look(&self, x_m: f64, y_m: f64, direction_rad: f64, range_max_m: f64) -> Option<Seen> {
        if !(x_m.is_finite() && y_m.is_finite() && direction_rad.is_finite()) {
            return Some(Seen { distance_m: 0.0, side: WallSide::Inside });
        }
        let mut last = None;
        // All beyond the map is blocked, so that this ends even with an endless range.
        for crossing in Traversal::new(x_m / self.cell_m(), y_m / self.cell_m(), direction_rad) {
            let distance_m = crossing.entry * self.cell_m();
            if distance_m > range_max_m {
                break;
            }
            let (column, row) = (crossing.column, crossing.row);
            if self.is_blocked(column, row) {
                return Some(Seen {
                    distance_m,
                    side: last.map_or(WallSide::Inside, |from| entered(from, column, row)),
                });
            }
            last = Some((column, row));
        }
        None
    }

    /// Distance to the first blocked square in this direction, as [`World::look`] finds it.
    pub fn cast(&self, x_m: f64, y_m: f64, direction_rad: f64, range_max_m: f64) -> Option<f64> {
        self.look(x_m, y_m, direction_rad, range_max_m).map(|seen| seen.distance_m)
    }
}

/// The side by which a ray comes into a square from the one before, in which column or row are others.
fn entered(from: (i64, i64), column: i64, row: i64) -> WallSide {
    match (column.cmp(&from.0), row.cmp(&from.1)) {
        (std::cmp::Ordering::Less, _) => WallSide::East,
        (std::cmp::Ordering::Greater, _) => WallSide::West,
        (_, std::cmp::Ordering::Less) => WallSide::North,
        _ => WallSide::South,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// A block in the middle of a free square, seen from its four sides.
    #[test]
    fn a_ray_meets_the_side_that_points_back_to_it() {
        let world = "rohrpost-map 1\ncell_m 0.5\nmap\n     \n     \n  #  \n     \n>    \n";
        let world = World::parse(world).unwrap();
        for (x_m, y_m, direction_rad, side) in [
            (0.25, 1.25, 0.0, WallSide::West),
            (2.25, 1.25, PI, WallSide::East),
            (1.25, 0.25, FRAC_PI_2, WallSide::South),
            (1.25, 2.25, -FRAC_PI_2, WallSide::North),
        ] {
            assert_eq!(world.look(x_m, y_m, direction_rad, 9.0), Some(Seen { distance_m: 0.75, side }));
        }
    }

    #[test]
    fn inside_a_wall_no_side_is_seen() {
        let world = World::parse("rohrpost-map 1\ncell_m 1\nmap\n#>#\n").unwrap();
        let inside = Some(Seen { distance_m: 0.0, side: WallSide::Inside });
        assert_eq!(world.look(0.5, 0.5, 0.0, 9.0), inside);
        assert_eq!(world.look(f64::NAN, 0.5, 0.0, 9.0), inside);
        assert_eq!(world.look(1.5, 0.5, f64::INFINITY, 9.0), inside);
    }
}
