//! One world: a robot in it, a motor and a scanner with delays, a driver, and people that walk about.

use super::people::Person;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rohrpost_modules::types::{LaserScan, Pose, Twist};
use rohrpost_robot::simulator::{STEP_NS, Scanner, Settings as RobotSettings, Simulator};
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Envelope, Limits, MapPose, Motion, Mounting, Scan, Sight, Verdict, Walls};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

pub(crate) const MS: u64 = 1_000_000;

/// Readings are off by this standard deviation, where walls are known.
const NOISE_M: f64 = 0.003;
/// What is known of walls; the pose is off by half of the error.
pub(crate) const WALLS: Walls = Walls { error_m: 0.02, error_rad: 0.01, depth_m: 0.1 };

/// Nothing comes from further behind a reading in the time that counts, metres.
const STANDS_M: f32 = 2.0;

/// What came of one world.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    /// How often something that stands was touched.
    pub(crate) bumps: u64,
    /// Steps in which the robot rolled against a person.
    pub(crate) pushes: u64,
    /// Commands to drive, those capped or refused, and the way that was made.
    pub(crate) checked: u64,
    pub(crate) changed: u64,
    pub(crate) way_m: f64,
}

/// What a driver wants, by the time and what the wheels say.
pub(crate) type Drive = Box<dyn FnMut(&mut ChaCha8Rng, &Limits, u64, Pose) -> Option<Command>>;

/// Between driver and motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Supervision {
    Nothing,
    Envelope,
    /// The envelope, which knows the world's walls, or is mistaken.
    WithWalls(Knowledge),
}

/// What the envelope takes for wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Knowledge {
    /// What is told by these.
    By(Walls),
    /// Mistaken: each reading stands, people too.
    EachReading,
    /// Mistaken: walls are left out of the scan, as if they were known well enough not to be looked at.
    LeftOut,
}

pub(crate) struct Trial {
    random: ChaCha8Rng,
    pub(crate) robot: Simulator,
    pub(crate) limits: Limits,
    mounting: Mounting,
    motion: Motion,
    sight: Sight,
    scan_period_ns: u64,
    scan_delay_ns: u64,
    look_ns: u64,
    /// What is on its way to the motor, and when it arrives.
    to_motor: VecDeque<(u64, Command)>,
    /// Scans on their way, by when they arrive.
    to_wormhole: VecDeque<(u64, Taken)>,
    seen: Option<Taken>,
    wanted: Command,
    driver: Drive,
    supervision: Supervision,
    people: Vec<Person>,
    outcome: Outcome,
}

/// A scan, when and about where it was taken, and where something may come from.
struct Taken {
    taken_ns: u64,
    scan: LaserScan,
    moving_m: Vec<f32>,
}

impl Taken {
    fn seen(&self) -> Scan<'_> {
        let LaserScan { start_rad, step_rad, range_max_m, .. } = self.scan;
        Scan {
            taken_ns: self.taken_ns,
            start_rad: start_rad.into(),
            step_rad: step_rad.into(),
            range_max_m: range_max_m.into(),
            ranges_m: &self.scan.ranges_m,
            moving_m: &self.moving_m,
        }
    }
}

impl Trial {
    /// A robot as chance has it, in a world by the same chance.
    pub(crate) fn new(
        seed: u64,
        world: impl FnOnce(&mut ChaCha8Rng) -> World,
        driver: Drive,
        supervision: Supervision,
    ) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sees_all_around = random.random_bool(0.5);
        let mut at = |least: f64, most: f64| random.random_range(least..most);
        let mounting = if sees_all_around {
            Mounting { x_m: at(-0.15, 0.15), y_m: at(-0.15, 0.15), heading_rad: at(-PI, PI) }
        } else {
            Mounting { x_m: at(-0.05, 0.0), y_m: 0.0, heading_rad: 0.0 }
        };
        let scanner = Scanner {
            beams: if sees_all_around { 360 } else { 181 },
            field_of_view_rad: if sees_all_around { TAU } else { PI },
            range_max_m: at(1.5, 8.0),
            mounting: Pose { x_m: mounting.x_m, y_m: mounting.y_m, heading_rad: mounting.heading_rad },
            ..Scanner::default()
        };
        let robot = RobotSettings {
            seed,
            scanner,
            acceleration_max_m_s2: random.random_range(0.5..2.0),
            turn_acceleration_max_rad_s2: random.random_range(2.0..8.0),
            dead_man_ns: 10_000 * MS,
            ..RobotSettings::default()
        };
        let limits = Limits {
            radius_m: robot.radius_m,
            margin_m: 0.06,
            speed_max_m_s: robot.speed_max_m_s,
            turn_rate_max_rad_s: robot.turn_rate_max_rad_s,
            braking_m_s2: robot.acceleration_max_m_s2,
            turn_braking_rad_s2: robot.turn_acceleration_max_rad_s2,
            lag_s: random.random_range(0.02..0.2),
            look_s: random.random_range(0.02..0.2),
            others_m_s: 0.0,
        };
        Self {
            robot: Simulator::new(world(&mut random), robot),
            motion: limits.motion(),
            sight: Sight::new(500 * MS),
            scan_period_ns: random.random_range(5..20) * STEP_NS,
            scan_delay_ns: random.random_range(0..15) * STEP_NS,
            look_ns: ((limits.look_s * 1e9) as u64 / STEP_NS).max(1) * STEP_NS,
            limits,
            mounting,
            random,
            to_motor: VecDeque::new(),
            to_wormhole: VecDeque::new(),
            seen: None,
            wanted: Command::STOP,
            driver,
            supervision,
            people: Vec::new(),
            outcome: Outcome::default(),
        }
    }

    /// With people that walk no faster than this.
    pub(crate) fn with_people(mut self, count: usize, speed_m_s: f64) -> Self {
        self.limits.others_m_s = speed_m_s;
        self.robot.set_range_noise(NOISE_M);
        let world = self.robot.world();
        self.people = (0..count).map(|_| Person::somewhere(&mut self.random, world, speed_m_s)).collect();
        self
    }

    pub(crate) fn run(&mut self, steps: u64) -> &Outcome {
        self.motion.tell(0, Command::STOP);
        for step in 0..steps {
            self.step(step * STEP_NS);
        }
        self.outcome.bumps = self.robot.bumps();
        &self.outcome
    }

    fn step(&mut self, now_ns: u64) {
        let before = self.robot.true_pose();
        while let Some((_, command)) = self.to_motor.pop_front_if(|(at_ns, _)| *at_ns <= now_ns) {
            let twist = Twist { speed_m_s: command.speed_m_s, turn_rate_rad_s: command.turn_rate_rad_s };
            self.robot.command(twist, now_ns).expect("it is a number");
        }
        self.robot.step_to(now_ns);
        let after = self.robot.true_pose();
        let (x_m, y_m) = (after.x_m - before.x_m, after.y_m - before.y_m);
        self.outcome.way_m += x_m.hypot(y_m);
        for person in &mut self.people {
            self.outcome.pushes += u64::from(person.is_pushed(after, (x_m, y_m), self.limits.radius_m));
            person.step(&mut self.random, self.robot.world(), after, self.limits.radius_m);
        }
        if now_ns.is_multiple_of(self.scan_period_ns) {
            let taken = self.take(now_ns);
            self.to_wormhole.push_back((now_ns + self.scan_delay_ns, taken));
        }
        while let Some((_, taken)) = self.to_wormhole.pop_front_if(|(at_ns, _)| *at_ns <= now_ns) {
            let moved = self.motion.from(taken.taken_ns) != self.motion.at(u64::MAX);
            if self.sight.look(now_ns, &taken.seen(), moved).is_ok() {
                self.seen = Some(taken);
            }
        }
        let by_wheels = self.robot.odometry().pose;
        self.wanted = (self.driver)(&mut self.random, &self.limits, now_ns, by_wheels).unwrap_or(self.wanted);
        if now_ns.is_multiple_of(self.look_ns) {
            self.look(now_ns);
        }
    }

    /// Looks around: walls, and people before them.
    fn take(&mut self, taken_ns: u64) -> Taken {
        let mut scan = self.robot.scan();
        let pose = self.robot.true_pose();
        let eye = Pose::from(pose.isometry() * self.robot.mounting().isometry());
        for person in &self.people {
            person.hide(eye, &mut scan);
        }
        let mut taken = Taken { taken_ns, scan, moving_m: Vec::new() };
        if let Supervision::WithWalls(knowledge) = self.supervision {
            let mut off = |error: f64| self.random.random_range(-0.5 * error..0.5 * error);
            let pose = MapPose {
                x_m: pose.x_m + off(WALLS.error_m) / 2.0,
                y_m: pose.y_m + off(WALLS.error_m) / 2.0,
                heading_rad: pose.heading_rad + off(WALLS.error_rad),
            };
            let mut moving_m = vec![0.0; taken.scan.ranges_m.len()];
            let is_wall = |x_m, y_m, radius_m| self.robot.world().disc_is_blocked(x_m, y_m, radius_m);
            let walls = if let Knowledge::By(walls) = knowledge { walls } else { WALLS };
            walls.moving_m(&taken.seen(), self.mounting, pose, is_wall, &mut moving_m);
            let readings = taken.scan.ranges_m.iter_mut().zip(&mut moving_m);
            match knowledge {
                Knowledge::By(_) => {}
                Knowledge::EachReading => readings.for_each(|(range_m, moving_m)| *moving_m = *range_m + STANDS_M),
                Knowledge::LeftOut => {
                    readings.filter(|(range_m, moving_m)| moving_m != range_m).for_each(|(range_m, moving_m)| {
                        (*range_m, *moving_m) = (taken.scan.range_max_m, taken.scan.range_max_m)
                    })
                }
            }
            taken.moving_m = moving_m;
        }
        taken
    }

    fn look(&mut self, now_ns: u64) {
        let command = if self.supervision == Supervision::Nothing { self.wanted } else { self.checked(now_ns) };
        self.motion.tell(now_ns, command);
        let lag_ns = self.random.random_range(0..=(self.limits.lag_s * 1e9) as u64 / STEP_NS - 1) * STEP_NS;
        let last_ns = self.to_motor.back().map_or(0, |(at_ns, _)| *at_ns);
        self.to_motor.push_back(((now_ns + lag_ns).max(last_ns), command));
    }

    fn checked(&mut self, now_ns: u64) -> Command {
        let Some(taken) = self.seen.as_ref().filter(|taken| !self.sight.is_old(now_ns, taken.taken_ns)) else {
            return Command::STOP;
        };
        let envelope = Envelope::new(self.limits, self.mounting);
        let verdict = envelope.check(now_ns, self.wanted, &taken.seen(), &self.motion);
        if self.wanted.speed_m_s != 0.0 {
            self.outcome.checked += 1;
            self.outcome.changed += u64::from(!matches!(verdict, Verdict::Passed(_)));
        }
        verdict.command()
    }
}
