//! Which points of a scan are walls, by a map: they stand still, whatever else moves.
//!
//! What moves may come nearer between a scan and the robot's stop. So the envelope lets each point of the scan grow; a
//! robot along a wall would hardly drive, as if the wall could walk. A map says that it cannot. But a mistaken wall is
//! a person that is taken for standing, so this is strict:
//!
//! ```text
//!            near a wall  solid: the whole disc of the error is in the map's walls
//!            ◀──────────▶◀─────────────────────▶
//!  scanner ──────────×──────(···)──────(···)────|──────── free, by the map
//!             reading ▲                         ▲ from here on something may come
//! ```
//!
//! - *Solid* is a place that no error of the pose can have moved into a wall. A reading is never so: the surface of a
//!   wall is half free. So a reading is a wall if it is *near*: less than the *depth* away from what is solid; and if
//!   its beam, prolonged, stays near until it is solid. A beam that only grazes the end of a wall leaves it again, and
//!   is none.
//! - What leans against a wall has parts that are near, too, and these count as wall. Something round does not touch
//!   the robot with such a part, if its radius and the robot's are greater than the depth: where two discs beside a
//!   wall touch, they are further from the wall than the smaller radius. So the depth is to be less than the
//!   radius of the thinnest thing that moves.
//! - A wall hides what is behind it. It stands still; what it hides does not, and may come round its end. So the beam
//!   is followed until it is no longer solid: from there on something may come, as from a point that was seen there. Of
//!   a wall that is thicker than what can come meanwhile, only the wall counts.
//! - What is off the map is not solid. Without a pose nothing is.

use crate::sector::Direction;
use crate::{Mounting, Scan};
use core::f64::consts::TAU;
use libm::hypot;

/// A beam is looked at so often along its way, metres.
const STEP_M: f64 = 0.025;
/// A beam is followed for so many steps, 2 m: nothing comes from further away in the time that counts.
const STEPS_MAX: u32 = 80;
/// Something solid is looked for in so many directions.
const DIRECTIONS: u32 = 16;

/// Where the robot is on the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPose {
    /// Along x, metres.
    pub x_m: f64,
    /// Along y, metres.
    pub y_m: f64,
    /// Where the robot looks, counter-clockwise from x, radians.
    pub heading_rad: f64,
}

/// Tells walls from what may move. What it promises is as true as these are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walls {
    /// Pose, map and reading are together off by less, metres.
    pub error_m: f64,
    /// The heading is off by less, radians.
    pub error_rad: f64,
    /// All that moves has a greater radius, metres; so has the robot.
    pub depth_m: f64,
}

impl Walls {
    /// The least depth with which walls are known, metres.
    pub fn depth_min_m(error_m: f64) -> f64 {
        2.0 * error_m + STEP_M
    }

    /// From where on something that moves may come, by beam, metres: one for each reading, as long as there is room.
    /// `is_wall(x_m, y_m, radius_m)`: whether all of a disc of the map is wall.
    pub fn moving_m(
        &self,
        scan: &Scan<'_>,
        mounting: Mounting,
        pose: MapPose,
        is_wall: impl Fn(f64, f64, f64) -> bool,
        moving_m: &mut [f32],
    ) {
        let robot = Direction::of(pose.heading_rad);
        let arm_m = hypot(mounting.x_m, mounting.y_m);
        let x_m = pose.x_m + mounting.x_m * robot.x - mounting.y_m * robot.y;
        let y_m = pose.y_m + mounting.x_m * robot.y + mounting.y_m * robot.x;
        let turn = Direction::of(scan.step_rad);
        let mut beam = Direction::of(pose.heading_rad + mounting.heading_rad + scan.start_rad);
        for (range_m, moving_m) in scan.ranges_m.iter().zip(moving_m) {
            let is_hit = Scan::is_reading(*range_m) && f64::from(*range_m) < scan.range_max_m;
            *moving_m = *range_m;
            if is_hit {
                let on_beam = |along_m: f64| Spot {
                    x_m: x_m + along_m * beam.x,
                    y_m: y_m + along_m * beam.y,
                    // Half a step more: so is all that is between this look and the next one.
                    radius_m: self.error_m + self.error_rad * (arm_m + along_m) + 0.5 * STEP_M,
                };
                *moving_m = self.solid_until_m((*range_m).into(), on_beam, &is_wall) as f32;
            }
            beam = beam.turned(turn);
        }
    }

    /// Where a beam that was stopped at a range leaves the wall; that range if it is none.
    fn solid_until_m(&self, range_m: f64, on_beam: impl Fn(f64) -> Spot, is_wall: &impl IsWall) -> f64 {
        let along_m = |step: u32| range_m + f64::from(step) * STEP_M;
        let is_solid = |step: &u32| on_beam(along_m(*step)).is_solid(is_wall);
        let is_near = |step: &u32| self.is_near(on_beam(along_m(*step)), is_wall);
        let mut steps = 0..STEPS_MAX;
        let Some(first) = steps.find(|step| is_solid(step) || !is_near(step)).filter(is_solid) else { return range_m };
        along_m(steps.take_while(is_solid).last().unwrap_or(first))
    }

    /// Whether something solid is as near as the depth.
    fn is_near(&self, spot: Spot, is_wall: &impl IsWall) -> bool {
        let turn = Direction::of(TAU / f64::from(DIRECTIONS));
        let directions = core::iter::successors(Some(Direction { x: 1.0, y: 0.0 }), |last| Some(last.turned(turn)));
        directions.take(DIRECTIONS as usize).any(|Direction { x, y }| {
            let deep = Spot { x_m: spot.x_m + self.depth_m * x, y_m: spot.y_m + self.depth_m * y, ..spot };
            deep.is_solid(is_wall)
        })
    }
}

/// Whether all of a disc of the map is wall: x, y and radius, metres.
trait IsWall: Fn(f64, f64, f64) -> bool {}
impl<F: Fn(f64, f64, f64) -> bool> IsWall for F {}

/// A place on the map, and how far off it may be.
#[derive(Clone, Copy)]
struct Spot {
    x_m: f64,
    y_m: f64,
    radius_m: f64,
}

impl Spot {
    fn is_solid(self, is_wall: &impl IsWall) -> bool {
        is_wall(self.x_m, self.y_m, self.radius_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;

    const WALLS: Walls = Walls { error_m: 0.02, error_rad: 0.0, depth_m: 0.1 };
    const HERE: MapPose = MapPose { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 };

    const SCAN: Scan<'_> =
        Scan { taken_ns: 0, start_rad: 0.0, step_rad: 0.1, range_max_m: 8.0, ranges_m: &[], moving_m: &[] };

    /// From where on something may come, of a robot that looks along x at a wall from 2 m to `back_m`.
    fn moving_m(walls: Walls, pose: MapPose, back_m: f64, range_m: f32) -> f64 {
        let ranges_m = [range_m];
        let scan = Scan { ranges_m: &ranges_m, ..SCAN };
        let mut moving_m = [0.0];
        let is_wall = |x_m: f64, _: f64, radius_m: f64| x_m - radius_m >= 2.0 && x_m + radius_m <= back_m;
        walls.moving_m(&scan, Mounting::default(), pose, is_wall, &mut moving_m);
        moving_m[0].into()
    }

    #[test]
    fn a_wall_stands_and_hides_what_is_behind_it_and_what_is_before_it_may_move() {
        for (range_m, back_m, least_m, most_m, why) in [
            (2.0, 2.5, 2.43, 2.48, "through the wall, up to where the error may end it"),
            (2.02, 2.5, 2.43, 2.48, "off by the error, into it"),
            (1.98, 2.5, 2.43, 2.48, "off by the error, before it"),
            (2.0, 100.0, 3.9, 4.1, "through a thick one no further than counts"),
            (1.92, 2.5, 1.92, 1.92, "a leg before the wall"),
            (1.0, 2.5, 1.0, 1.0, "in the open"),
            (2.0, 2.05, 2.0, 2.0, "a wall so thin that the error may have made it"),
            (8.0, 100.0, 8.0, 8.0, "nothing came back"),
        ] {
            let told_m = moving_m(WALLS, HERE, back_m, range_m as f32);
            assert!((least_m - 1e-6..=most_m + 1e-6).contains(&told_m), "{why}: {told_m}");
        }
    }

    #[test]
    fn a_wall_that_a_beam_meets_at_a_small_angle_is_one_and_a_wall_s_end_is_none() {
        // 10° to the wall that begins at y = 0, from 0.3 m beside it; it ends at 2 m or further.
        let slanting = MapPose { x_m: 0.0, y_m: -0.3, heading_rad: 10_f64.to_radians() };
        let range_m = 0.3 / 10_f64.to_radians().sin();
        let told_m = |end_m: f64| {
            let ranges_m = [range_m as f32];
            let scan = Scan { ranges_m: &ranges_m, ..SCAN };
            let is_wall = |x_m: f64, y_m: f64, radius_m: f64| y_m - radius_m >= 0.0 && x_m + radius_m <= end_m;
            let mut moving_m = [0.0];
            WALLS.moving_m(&scan, Mounting::default(), slanting, is_wall, &mut moving_m);
            f64::from(moving_m[0])
        };
        assert!(told_m(100.0) > range_m + 1.0);
        let end_m = range_m * 10_f64.to_radians().cos() + 0.1;
        assert!((told_m(end_m) - range_m).abs() < 1e-6, "it leaves the wall before the error allows to say so");
    }

    #[test]
    fn the_heading_s_error_counts_by_the_way_and_without_a_pose_nothing_is_wall() {
        let turned = Walls { error_rad: 0.01, ..WALLS };
        assert!(moving_m(turned, HERE, 2.5, 2.0) < 2.46);
        assert_eq!(moving_m(Walls { error_rad: 0.05, ..WALLS }, HERE, 2.5, 2.0), 2.0, "its wall begins too deep");
        assert_eq!(moving_m(WALLS, MapPose { x_m: f64::NAN, ..HERE }, 2.5, 2.0), 2.0);
    }

    #[test]
    fn with_the_least_depth_a_wall_is_known_and_with_less_it_is_not() {
        for error_m in [0.01, 0.02, 0.05] {
            let depth_m = Walls::depth_min_m(error_m);
            let known =
                |depth_m| moving_m(Walls { error_m, error_rad: 0.0, depth_m }, HERE, 9.0, (2.0 - error_m) as f32);
            assert!(known(depth_m) > 3.0 && known(depth_m - STEP_M) < 2.0, "{error_m}");
        }
    }
}
