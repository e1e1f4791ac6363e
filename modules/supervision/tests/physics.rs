//! The envelope against the physics of the simulated robot: whatever is commanded, nothing is touched; without it, the
//! same commands touch.
//!
//! `ROHRPOST_ENVELOPE_WORLDS=100000 cargo test --release -p rohrpost-supervision --test physics` is the full run.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rohrpost_modules::types::{LaserScan, Pose, Twist};
use rohrpost_robot::simulator::{STEP_NS, Scanner, Settings as RobotSettings, Simulator};
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Envelope, Limits, Motion, Mounting, Scan, Sight, Verdict};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Steps of one world.
const STEPS: u64 = 1500;
const MS: u64 = 1_000_000;

/// What came of one world.
#[derive(Debug, Default)]
struct Outcome {
    bumps: u64,
    /// Commands to drive, those capped or refused, and the way that was made.
    checked: u64,
    changed: u64,
    way_m: f64,
}

/// A world with blocks, a robot in it, a motor and a scanner with delays, and a driver that commands at random.
struct Trial {
    random: ChaCha8Rng,
    robot: Simulator,
    limits: Limits,
    mounting: Mounting,
    motion: Motion,
    sight: Sight,
    scan_period_ns: u64,
    scan_delay_ns: u64,
    look_ns: u64,
    /// What is on its way to the motor, and when it arrives.
    to_motor: VecDeque<(u64, Command)>,
    /// Scans on their way, by when they arrive.
    to_wormhole: VecDeque<(u64, u64, LaserScan)>,
    seen: Option<(u64, LaserScan)>,
    wanted: Command,
    is_supervised: bool,
    outcome: Outcome,
}

fn world(random: &mut ChaCha8Rng) -> World {
    const SIDE: usize = 30;
    let blocks = random.random_range(0.01..0.06);
    let mut text = "rohrpost-map 1\ncell_m 0.3\nmap\n".to_owned();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let from_start = row.abs_diff(SIDE / 2).max(column.abs_diff(SIDE / 2));
            let is_rim = row.min(column) == 0 || row.max(column) == SIDE - 1;
            let is_block = is_rim || (from_start > 2 && random.random_bool(blocks));
            text.push(if from_start == 0 {
                '>'
            } else if is_block {
                '#'
            } else {
                ' '
            });
        }
        text.push('\n');
    }
    World::parse(&text).expect("it is a map")
}

impl Trial {
    fn new(seed: u64, is_supervised: bool) -> Self {
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
            is_supervised,
            outcome: Outcome::default(),
        }
    }

    fn run(mut self) -> Outcome {
        self.motion.tell(0, Command::STOP);
        for step in 0..STEPS {
            self.step(step * STEP_NS);
        }
        self.outcome.bumps = self.robot.bumps();
        self.outcome
    }

    fn step(&mut self, now_ns: u64) {
        let before = self.robot.true_pose();
        while let Some((_, command)) = self.to_motor.pop_front_if(|(at_ns, _)| *at_ns <= now_ns) {
            let twist = Twist { speed_m_s: command.speed_m_s, turn_rate_rad_s: command.turn_rate_rad_s };
            self.robot.command(twist, now_ns).expect("it is a number");
        }
        self.robot.step_to(now_ns);
        let after = self.robot.true_pose();
        self.outcome.way_m += (after.x_m - before.x_m).hypot(after.y_m - before.y_m);
        if now_ns.is_multiple_of(self.scan_period_ns) {
            let scan = self.robot.scan();
            self.to_wormhole.push_back((now_ns + self.scan_delay_ns, now_ns, scan));
        }
        while let Some((_, taken_ns, scan)) = self.to_wormhole.pop_front_if(|(at_ns, ..)| *at_ns <= now_ns) {
            let moved = self.motion.from(taken_ns) != self.motion.at(u64::MAX);
            if self.sight.look(now_ns, &seen(taken_ns, &scan), moved).is_ok() {
                self.seen = Some((taken_ns, scan));
            }
        }
        if self.random.random_bool(0.02) {
            self.want();
        }
        if now_ns.is_multiple_of(self.look_ns) {
            self.look(now_ns);
        }
    }

    /// Somebody has another idea: on the spot, mostly straight ahead and fast, or anything.
    fn want(&mut self) {
        let (speed, turn) = (self.limits.speed_max_m_s, self.limits.turn_rate_max_rad_s);
        let (speed_m_s, turn_rate_rad_s) = match self.random.random_range(0..10) {
            0..4 => (0.0, self.random.random_range(-turn..turn)),
            4..8 => (speed, self.random.random_range(-0.2 * turn..0.2 * turn)),
            _ => (self.random.random_range(-1.2 * speed..1.2 * speed), self.random.random_range(-turn..turn)),
        };
        self.wanted = Command { speed_m_s, turn_rate_rad_s };
    }

    fn look(&mut self, now_ns: u64) {
        let command = if self.is_supervised { self.checked(now_ns) } else { self.wanted };
        self.motion.tell(now_ns, command);
        let lag_ns = self.random.random_range(0..=(self.limits.lag_s * 1e9) as u64 / STEP_NS - 1) * STEP_NS;
        let last_ns = self.to_motor.back().map_or(0, |(at_ns, _)| *at_ns);
        self.to_motor.push_back(((now_ns + lag_ns).max(last_ns), command));
    }

    fn checked(&mut self, now_ns: u64) -> Command {
        let Some((taken_ns, scan)) = self.seen.as_ref().filter(|(taken_ns, _)| !self.sight.is_old(now_ns, *taken_ns))
        else {
            return Command::STOP;
        };
        let envelope = Envelope::new(self.limits, self.mounting);
        let verdict = envelope.check(now_ns, self.wanted, &seen(*taken_ns, scan), &self.motion);
        if self.wanted.speed_m_s != 0.0 {
            self.outcome.checked += 1;
            self.outcome.changed += u64::from(!matches!(verdict, Verdict::Passed(_)));
        }
        verdict.command()
    }
}

fn seen(taken_ns: u64, scan: &LaserScan) -> Scan<'_> {
    Scan {
        taken_ns,
        start_rad: scan.start_rad.into(),
        step_rad: scan.step_rad.into(),
        range_max_m: scan.range_max_m.into(),
        ranges_m: &scan.ranges_m,
    }
}

fn worlds() -> u64 {
    std::env::var("ROHRPOST_ENVELOPE_WORLDS").ok().and_then(|count| count.parse().ok()).unwrap_or(100)
}

#[test]
fn nothing_is_touched_whatever_is_commanded_and_without_the_envelope_it_is() {
    let mut sum = Outcome::default();
    for seed in 0..worlds() {
        let outcome = Trial::new(seed, true).run();
        assert_eq!(outcome.bumps, 0, "seed {seed}: {outcome:?}");
        sum.checked += outcome.checked;
        sum.changed += outcome.changed;
        sum.way_m += outcome.way_m;
    }
    let bare = (0..worlds().min(100)).filter(|seed| Trial::new(*seed, false).run().bumps > 0).count() as u64;
    assert!(bare * 2 > worlds().min(100), "without the envelope only {bare} worlds were touched");
    assert!(sum.changed * 5 > sum.checked, "the envelope had too little to do: {sum:?}");
    assert!(sum.way_m > worlds() as f64, "the robot hardly drives: {sum:?}");
}
