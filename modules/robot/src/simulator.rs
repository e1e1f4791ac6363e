//! A simulated robot: a disc on two wheels with a range scanner, moved in steps of 10 ms.
//!
//! Time comes from the caller: the first stamp given is step 0. Everything random comes from the seed: the same seed,
//! commands and stamps give the same bits. Odometry and scanner draw from streams of their own, so that looking does
//! not change the way.

use super::surroundings::{Disc, Surroundings};
use super::world::World;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rohrpost_modules::fusion::wrap_rad;
use rohrpost_modules::types::{LaserScan, Odometry, Pose, Twist};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use thiserror::Error;

/// One step of the simulation.
pub const STEP_NS: u64 = 10_000_000;
const STEP_S: f64 = 0.01;

/// Steps that one call makes at most, 5 s: a caller that was away longer (a suspended computer) finds the robot where
/// it stood after these; the rest of the time is skipped and counted. The dead-man time is long over by then.
pub const STEPS_AT_ONCE_MAX: u64 = 500;

/// Nearer than this it still leans against what it hit.
const CLEAR_OF_CONTACT_M: f64 = 0.02;

/// The scanner: an even fan of beams around its own x axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Beams in a scan.
    pub beams: usize,
    /// Angle from the first beam to the last; with a full turn or more, to the first again.
    pub field_of_view_rad: f64,
    /// Nothing beyond is seen.
    pub range_max_m: f64,
    /// Standard deviation of a reading.
    pub range_noise_m: f64,
    /// Where it is mounted, in the robot's frame.
    pub mounting: Pose,
}

impl Default for Scanner {
    fn default() -> Self {
        Self {
            beams: 181,
            field_of_view_rad: std::f64::consts::PI,
            range_max_m: 8.0,
            range_noise_m: 0.01,
            mounting: Pose::default(),
        }
    }
}

/// The robot. Every default is that of a small indoor robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// All randomness.
    pub seed: u64,
    /// The robot is a disc.
    pub radius_m: f64,
    /// Forward and backward.
    pub speed_max_m_s: f64,
    /// To both sides.
    pub turn_rate_max_rad_s: f64,
    /// Speeding up and braking.
    pub acceleration_max_m_s2: f64,
    /// Angular acceleration limit, for turning faster and slower.
    pub turn_acceleration_max_rad_s2: f64,
    /// Without a command for so long, the wheels are braked.
    pub dead_man_ns: u64,
    /// Between the wheels.
    pub wheel_base_m: f64,
    /// Standard deviation of a wheel's share of error in each step; it averages out with the way.
    pub wheel_noise: f64,
    /// Standard deviation of a wheel's constant share of error, drawn once; it does not.
    pub wheel_scale_error: f64,
    /// What it sees with.
    pub scanner: Scanner,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            radius_m: 0.25,
            speed_max_m_s: 0.7,
            turn_rate_max_rad_s: 1.5,
            acceleration_max_m_s2: 1.0,
            turn_acceleration_max_rad_s2: 4.0,
            dead_man_ns: 500_000_000,
            wheel_base_m: 0.4,
            wheel_noise: 0.05,
            wheel_scale_error: 0.002,
            scanner: Scanner::default(),
        }
    }
}

/// The twist holds something that is not a number; it was not taken, and the dead-man time runs on.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("a command of {speed_m_s} m/s and {turn_rate_rad_s} rad/s is no motion")]
pub struct NoMotion {
    /// As commanded.
    pub speed_m_s: f64,
    /// As commanded.
    pub turn_rate_rad_s: f64,
}

impl NoMotion {
    /// Refuses what holds something that is not a number.
    ///
    /// # Errors
    /// The twist is no motion.
    pub fn check(Twist { speed_m_s, turn_rate_rad_s }: Twist) -> Result<(), Self> {
        let is_motion = speed_m_s.is_finite() && turn_rate_rad_s.is_finite();
        if is_motion { Ok(()) } else { Err(Self { speed_m_s, turn_rate_rad_s }) }
    }
}

/// What a call of [`Simulator::step_to`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stepped {
    /// Steps made.
    pub steps: u64,
    /// Steps left out, because the caller came too late.
    pub skipped: u64,
}

/// The robot drove against something. Leaning against it is one touch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// The time of the step, ns, as the caller counts it.
    pub at_ns: u64,
    /// The point of contact in the world, metres.
    pub x_m: f64,
    /// See `x_m`.
    pub y_m: f64,
    /// Speed of the robot, metres a second; below zero: backward.
    pub speed_m_s: f64,
    /// Whether the robot moved towards the point of contact. Then the touch counts against it.
    pub is_towards: bool,
}

/// A robot as it is at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// The time of the last step, ns.
    pub at_ns: u64,
    /// Where the robot really is.
    pub pose: Pose,
    /// What its wheels say.
    pub odometry: Odometry,
}

/// A robot in its world.
///
/// ```
/// use rohrpost_robot::{simulator::{Settings, Simulator}, world::World};
/// use rohrpost_modules::types::Twist;
/// let world = World::parse("rohrpost-map 1\ncell_m 1\nmap\n#######\n#>    #\n#######\n").unwrap();
/// let mut robot = Simulator::new(world, Settings::default());
/// robot.command(Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 }, 0).unwrap();
/// robot.step_to(400_000_000);
/// assert!(robot.true_pose().x_m > 1.55 && robot.bumps() == 0);
/// robot.step_to(2_000_000_000); // no further command: the dead-man time stops it
/// assert_eq!(robot.odometry().twist, Twist::default());
/// ```
#[derive(Clone, Debug)]
pub struct Simulator {
    surroundings: Surroundings,
    settings: Settings,
    /// Stamp of the last step; none before the first call.
    now_ns: Option<u64>,
    commanded: Twist,
    commanded_ns: u64,
    pose: Pose,
    twist: Twist,
    odometry: Pose,
    wheel_scale: [f64; 2],
    wheel_random: ChaCha8Rng,
    scan_random: ChaCha8Rng,
    bumps: u64,
    in_contact: bool,
    last_touch: Option<Touch>,
}

impl Simulator {
    /// Stands where the world says, which should have room for it: it can't drive out of a wall. Odometry begins at
    /// zero.
    pub fn new(world: World, settings: Settings) -> Self {
        let mut wheel_random = ChaCha8Rng::seed_from_u64(settings.seed);
        let mut scan_random = wheel_random.clone();
        scan_random.set_stream(1);
        let wheel_scale = [(); 2].map(|()| 1.0 + settings.wheel_scale_error * normal(&mut wheel_random));
        let pose = world.start();
        Self {
            surroundings: Surroundings { world, discs: Vec::new() },
            settings,
            now_ns: None,
            commanded: Twist::default(),
            commanded_ns: 0,
            pose,
            twist: Twist::default(),
            odometry: Pose::default(),
            wheel_scale,
            wheel_random,
            scan_random,
            bumps: 0,
            in_contact: false,
            last_touch: None,
        }
    }

    /// Steps to `now_ns`, then takes this as the motion to reach, within the limits.
    pub fn command(&mut self, twist: Twist, now_ns: u64) -> Result<Stepped, NoMotion> {
        NoMotion::check(twist)?;
        let Twist { speed_m_s, turn_rate_rad_s } = twist;
        let stepped = self.step_to(now_ns);
        let (speed_max, turn_max) = (self.settings.speed_max_m_s, self.settings.turn_rate_max_rad_s);
        self.commanded = Twist {
            speed_m_s: speed_m_s.clamp(-speed_max, speed_max),
            turn_rate_rad_s: turn_rate_rad_s.clamp(-turn_max, turn_max),
        };
        self.commanded_ns = now_ns.max(self.commanded_ns);
        Ok(stepped)
    }

    /// Makes all steps that are due, at most [`STEPS_AT_ONCE_MAX`]. A stamp of the past makes none.
    pub fn step_to(&mut self, now_ns: u64) -> Stepped {
        let last_ns = *self.now_ns.get_or_insert(now_ns);
        let due = now_ns.saturating_sub(last_ns) / STEP_NS;
        let steps = due.min(STEPS_AT_ONCE_MAX);
        for step in 1..=steps {
            self.step(last_ns + step * STEP_NS);
        }
        self.now_ns = Some(last_ns + due * STEP_NS);
        Stepped { steps, skipped: due - steps }
    }

    /// What the wheels say: from zero at the start, and drifting.
    pub fn odometry(&self) -> Odometry {
        Odometry { pose: self.odometry, twist: self.twist }
    }

    /// Time is another one from now on: the robot goes on from where it stands, and its last command is as old as it
    /// was.
    pub fn set_time(&mut self, now_ns: u64) {
        if let Some(last_ns) = self.now_ns.replace(now_ns) {
            let age_ns = last_ns.saturating_sub(self.commanded_ns);
            self.commanded_ns = now_ns.saturating_sub(age_ns);
        }
    }

    /// Where the robot really is, which no robot knows.
    pub fn true_pose(&self) -> Pose {
        self.pose
    }

    /// How often it drove against something; leaning against it counts once.
    pub fn bumps(&self) -> u64 {
        self.bumps
    }

    /// The last time that it drove against something.
    pub fn last_touch(&self) -> Option<Touch> {
        self.last_touch
    }

    /// The robot as it is now.
    pub fn moment(&self) -> Moment {
        Moment { at_ns: self.now_ns.unwrap_or_default(), pose: self.pose, odometry: self.odometry() }
    }

    /// Puts the robot where another simulator has it: from now on this one looks around there.
    pub fn place(&mut self, moment: Moment) {
        let Moment { at_ns, pose, odometry } = moment;
        (self.now_ns, self.pose) = (Some(at_ns), pose);
        (self.odometry, self.twist) = (odometry.pose, odometry.twist);
    }

    /// Where its scanner is mounted.
    pub fn mounting(&self) -> Pose {
        self.settings.scanner.mounting
    }

    /// The world it is in.
    pub fn world(&self) -> &World {
        &self.surroundings.world
    }

    /// What else is in the world from now on, to be touched and seen.
    pub fn set_others(&mut self, others: impl IntoIterator<Item = Disc>) {
        self.surroundings.discs.clear();
        self.surroundings.discs.extend(others);
    }

    /// Sets the standard deviation of a reading, from the next scan on.
    pub fn set_range_noise(&mut self, noise_m: f64) {
        self.settings.scanner.range_noise_m = noise_m;
    }

    /// Looks around from where it is now.
    pub fn scan(&mut self) -> LaserScan {
        let Scanner { beams, field_of_view_rad, range_max_m, range_noise_m, mounting } = self.settings.scanner;
        let eye = Pose::from(self.pose.isometry() * mounting.isometry());
        let gaps = if field_of_view_rad >= TAU { beams } else { beams.saturating_sub(1) };
        let step_rad = field_of_view_rad.min(TAU) / gaps.max(1) as f64;
        let mut scan = LaserScan {
            start_rad: (-0.5 * field_of_view_rad.min(TAU)) as f32,
            step_rad: step_rad as f32,
            range_max_m: range_max_m as f32,
            ranges_m: Vec::with_capacity(beams),
            pose: None,
        };
        for beam in 0..beams {
            let direction_rad = eye.heading_rad + scan.angle_rad(beam);
            // Drawn for every beam, so that what one beam sees does not shift the noise of the next.
            let noise_m = range_noise_m * normal(&mut self.scan_random);
            let range_m =
                self.surroundings.cast(eye.x_m, eye.y_m, direction_rad, range_max_m).map(|range_m| range_m + noise_m);
            scan.ranges_m.push(range_m.map_or(range_max_m, |range_m| range_m.clamp(0.001, range_max_m)) as f32);
        }
        scan
    }

    fn step(&mut self, now_ns: u64) {
        let dead = now_ns.saturating_sub(self.commanded_ns) > self.settings.dead_man_ns;
        let target = if dead { Twist::default() } else { self.commanded };
        let speed_change = self.settings.acceleration_max_m_s2 * STEP_S;
        let turn_change = self.settings.turn_acceleration_max_rad_s2 * STEP_S;
        self.twist.speed_m_s = towards(self.twist.speed_m_s, target.speed_m_s, speed_change);
        self.twist.turn_rate_rad_s = towards(self.twist.turn_rate_rad_s, target.turn_rate_rad_s, turn_change);
        self.roll(now_ns);
    }

    /// Moves with the present twist, or turns on the spot if something is in the way.
    fn roll(&mut self, now_ns: u64) {
        let turn_rad = self.twist.turn_rate_rad_s * STEP_S;
        let next = advanced(self.pose, self.twist.speed_m_s * STEP_S, turn_rad);
        if let Some((x_m, y_m)) = self.surroundings.contact(next.x_m, next.y_m, self.settings.radius_m) {
            if !self.in_contact {
                self.bumps += 1;
                let way = (next.x_m - self.pose.x_m, next.y_m - self.pose.y_m);
                let is_towards = way.0 * (x_m - self.pose.x_m) + way.1 * (y_m - self.pose.y_m) > 0.0;
                let speed_m_s = self.twist.speed_m_s;
                self.last_touch = Some(Touch { at_ns: now_ns, x_m, y_m, speed_m_s, is_towards });
            }
            self.in_contact = true;
            self.twist.speed_m_s = 0.0;
            self.pose.heading_rad = next.heading_rad;
        } else {
            // A robot that pushes creeps and stops in turn: only one that came away may bump again.
            let clear_m = self.settings.radius_m + CLEAR_OF_CONTACT_M;
            self.in_contact &= self.surroundings.contact(next.x_m, next.y_m, clear_m).is_some();
            self.pose = next;
        }
        self.count_wheels(self.twist.speed_m_s * STEP_S, turn_rad);
    }

    /// Odometry: what the wheels rolled, each with its errors.
    fn count_wheels(&mut self, way_m: f64, turn_rad: f64) {
        let half_base_m = 0.5 * self.settings.wheel_base_m;
        let mut rolled = [way_m - turn_rad * half_base_m, way_m + turn_rad * half_base_m];
        for (rolled_m, scale) in rolled.iter_mut().zip(self.wheel_scale) {
            *rolled_m *= scale * (1.0 + self.settings.wheel_noise * normal(&mut self.wheel_random));
        }
        let [left_m, right_m] = rolled;
        self.odometry =
            advanced(self.odometry, 0.5 * (left_m + right_m), (right_m - left_m) / self.settings.wheel_base_m);
    }
}

/// Along an arc; a step is so short that the chord at the middle heading is as good.
fn advanced(pose: Pose, way_m: f64, turn_rad: f64) -> Pose {
    let (sin, cos) = (pose.heading_rad + 0.5 * turn_rad).sin_cos();
    Pose {
        x_m: pose.x_m + way_m * cos,
        y_m: pose.y_m + way_m * sin,
        heading_rad: wrap_rad(pose.heading_rad + turn_rad),
    }
}

fn towards(now: f64, target: f64, change_max: f64) -> f64 {
    now + (target - now).clamp(-change_max, change_max)
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

#[cfg(test)]
#[path = "simulator_tests.rs"]
mod tests;
