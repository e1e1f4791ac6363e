//! What walks about in a world: discs that go through no wall and lean against it.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rohrpost_modules::types::{LaserScan, Pose};
use rohrpost_robot::simulator::STEP_NS;
use rohrpost_robot::world::World;
use std::f64::consts::TAU;

pub(crate) struct Person {
    x_m: f64,
    y_m: f64,
    radius_m: f64,
    speed_m_s: f64,
    heading_rad: f64,
}

impl Person {
    /// In a free place, away from the robot's start.
    pub(crate) fn somewhere(random: &mut ChaCha8Rng, world: &World, speed_m_s: f64) -> Self {
        let (radius_m, heading_rad) = (random.random_range(0.1..0.25), random.random_range(0.0..TAU));
        let (width_m, height_m) = world.size_m();
        let start = world.start();
        loop {
            let (x_m, y_m) = (random.random_range(0.0..width_m), random.random_range(0.0..height_m));
            let is_away = (x_m - start.x_m).hypot(y_m - start.y_m) > 1.0;
            if is_away && !world.disc_collides(x_m, y_m, radius_m) {
                return Self { x_m, y_m, radius_m, speed_m_s, heading_rad };
            }
        }
    }

    /// Goes on, or slides along what is in the way, also the robot, and has another idea now and then.
    pub(crate) fn step(&mut self, random: &mut ChaCha8Rng, world: &World, robot: Pose, robot_radius_m: f64) {
        if random.random_bool(0.01) {
            self.heading_rad = random.random_range(0.0..TAU);
        }
        let way_m = self.speed_m_s * STEP_NS as f64 * 1e-9;
        let (sin, cos) = self.heading_rad.sin_cos();
        for (x_m, y_m) in [(way_m * cos, way_m * sin), (way_m * cos, 0.0), (0.0, way_m * sin)] {
            let (x_m, y_m) = (self.x_m + x_m, self.y_m + y_m);
            let is_robot = (x_m - robot.x_m).hypot(y_m - robot.y_m) < self.radius_m + robot_radius_m;
            if !is_robot && !world.disc_collides(x_m, y_m, self.radius_m) {
                (self.x_m, self.y_m) = (x_m, y_m);
                return;
            }
        }
    }

    /// Whether the robot touches this person, and has rolled that way in its last step.
    pub(crate) fn is_pushed(&self, robot: Pose, rolled_m: (f64, f64), radius_m: f64) -> bool {
        let (x_m, y_m) = (self.x_m - robot.x_m, self.y_m - robot.y_m);
        x_m.hypot(y_m) < radius_m + self.radius_m && x_m * rolled_m.0 + y_m * rolled_m.1 > 0.0
    }

    /// Shortens the beams that end here.
    pub(crate) fn hide(&self, eye: Pose, scan: &mut LaserScan) {
        let (x_m, y_m) = (self.x_m - eye.x_m, self.y_m - eye.y_m);
        for beam in 0..scan.ranges_m.len() {
            let (sin, cos) = (eye.heading_rad + scan.angle_rad(beam)).sin_cos();
            let (along_m, across_m) = (x_m * cos + y_m * sin, y_m * cos - x_m * sin);
            if along_m > 0.0 && across_m.abs() < self.radius_m {
                let hit_m = along_m - (self.radius_m.powi(2) - across_m.powi(2)).sqrt();
                scan.ranges_m[beam] = scan.ranges_m[beam].min(hit_m.max(0.001) as f32);
            }
        }
    }
}
