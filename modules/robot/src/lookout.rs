//! What a scan shows that the map does not: obstacles, and places that are seen to be empty.

use crate::world::World;
use rohrpost_modules::types::{LaserScan, Pose};
use std::f64::consts::{PI, TAU};

/// A scan of a robot at a known place of a map.
pub struct Lookout<'a> {
    /// The map.
    pub world: &'a World,
    /// Where the scanner stood.
    pub pose: Pose,
    /// What it saw.
    pub scan: &'a LaserScan,
    /// Error of pose and reading together; echoes so near a wall are the wall's, metres.
    pub error_m: f64,
}

impl Lookout<'_> {
    /// Places of echoes that no wall explains, metres; those within `gate_m` of one before are left out.
    pub fn obstacles(&self, gate_m: f64) -> Vec<(f64, f64)> {
        let mut obstacles: Vec<(f64, f64)> = Vec::new();
        for (angle_rad, range_m) in self.scan.hits() {
            let (sin, cos) = (self.pose.heading_rad + angle_rad).sin_cos();
            let (x_m, y_m) = (self.pose.x_m + range_m * cos, self.pose.y_m + range_m * sin);
            let is_near = |(other_x, other_y): &(f64, f64)| (x_m - other_x).hypot(y_m - other_y) <= gate_m;
            if !self.world.disc_collides(x_m, y_m, self.error_m) && !obstacles.iter().any(is_near) {
                obstacles.push((x_m, y_m));
            }
        }
        obstacles
    }

    /// Whether something at this place would have been seen: a beam goes through it, to something `gate_m` behind it.
    pub fn can_see(&self, x_m: f64, y_m: f64, gate_m: f64) -> bool {
        let (ahead_m, aside_m) = (x_m - self.pose.x_m, y_m - self.pose.y_m);
        let turn_rad =
            (aside_m.atan2(ahead_m) - self.pose.heading_rad - self.scan.angle_rad(0) + PI).rem_euclid(TAU) - PI;
        let steps = turn_rad / f64::from(self.scan.step_rad);
        // A scan of a full circle begins anywhere.
        let circle = TAU / f64::from(self.scan.step_rad).abs();
        let beam = if steps < -0.5 { steps + circle } else { steps }.round();
        let reach_m = if beam >= 0.0 { self.scan.ranges_m.get(beam as usize).copied() } else { None };
        reach_m.is_some_and(|reach_m| f64::from(reach_m) >= ahead_m.hypot(aside_m) + gate_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn world() -> World {
        World::parse("rohrpost-map 1\ncell_m 1.0\nmap\n########\n#>     #\n#      #\n########\n").unwrap()
    }

    /// Seven beams from -90 to 90 degrees; the walls' own distances but for changes.
    fn scan(world: &World, pose: Pose, changes: &[(usize, f32)]) -> LaserScan {
        let step_rad = (PI / 6.0) as f32;
        let cast = |beam: usize| {
            let angle_rad = pose.heading_rad - PI / 2.0 + beam as f64 * f64::from(step_rad);
            world.cast(pose.x_m, pose.y_m, angle_rad, 20.0).unwrap_or(20.0) as f32
        };
        let mut ranges_m: Vec<f32> = (0..7).map(cast).collect();
        changes.iter().for_each(|(beam, range_m)| ranges_m[*beam] = *range_m);
        LaserScan { start_rad: -(PI / 2.0) as f32, step_rad, range_max_m: 20.0, ranges_m, pose: None }
    }

    #[test]
    fn what_stands_before_a_wall_is_an_obstacle_and_a_wall_is_none() {
        let (world, pose) = (world(), Pose { x_m: 1.5, y_m: 2.0, heading_rad: 0.0 });
        let walls = scan(&world, pose, &[]);
        let lookout = Lookout { world: &world, pose, scan: &walls, error_m: 0.1 };
        assert_eq!(lookout.obstacles(0.5), []);
        let nothing_came_back = scan(&world, pose, &[(3, 20.0), (2, f32::NAN)]);
        assert_eq!(Lookout { scan: &nothing_came_back, ..lookout }.obstacles(0.5), []);
        let met = scan(&world, pose, &[(3, 3.0)]);
        let [(x_m, y_m)] = Lookout { scan: &met, ..lookout }.obstacles(0.5)[..] else { panic!("one obstacle") };
        assert!((x_m - 4.5).abs() < 1e-6 && (y_m - 2.0).abs() < 1e-6, "{x_m} {y_m}");
    }

    #[test]
    fn a_place_is_seen_empty_only_through_a_beam_that_goes_on() {
        let (world, pose) = (world(), Pose { x_m: 1.5, y_m: 2.0, heading_rad: 0.0 });
        let open = scan(&world, pose, &[]);
        let met = scan(&world, pose, &[(3, 3.0)]);
        for (scan, (x_m, y_m), sees, why) in [
            (&open, (4.5, 2.0), true, "nothing is between"),
            (&met, (4.5, 2.0), false, "there it is"),
            (&met, (6.0, 2.0), false, "it stands before"),
            (&met, (3.0, 2.0), true, "it stands far behind"),
            (&open, (1.2, 2.0), false, "behind the robot"),
            (&open, (9.0, 2.0), false, "behind the wall"),
        ] {
            let lookout = Lookout { world: &world, pose, scan, error_m: 0.1 };
            assert_eq!(lookout.can_see(x_m, y_m, 0.5), sees, "{why}");
        }
        let turned = Pose { heading_rad: PI, ..pose };
        let behind = scan(&world, turned, &[]);
        let lookout = Lookout { world: &world, pose: turned, scan: &behind, error_m: 0.1 };
        assert!(!lookout.can_see(4.5, 2.0, 0.5) && lookout.can_see(1.3, 2.0, 0.2));
    }
}
