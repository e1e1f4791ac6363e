//! The seed's tests as files (`config/team/*.toml`): a scene, what happens in it, and what is expected of it.

use crate::scene::{drawn, steps_to_intruder};
use crate::standard::S_NS;
use crate::world::World;
use rohrpost_payload::{Mode, Settings};
use rohrpost_team::RobotId;
use rohrpost_team::grid::Direction;
use serde::Deserialize;
use std::fmt;
use std::path::Path;

/// Why a file is no scenario.
#[derive(Debug, thiserror::Error)]
pub enum NoScenario {
    /// A file that cannot be read.
    #[error("{path}: {error}")]
    File {
        /// Which.
        path: String,
        /// Why.
        error: std::io::Error,
    },
    /// A file that says something else.
    #[error("{path}: {error}")]
    Toml {
        /// Which.
        path: String,
        /// Where and why.
        error: toml::de::Error,
    },
    /// A robot that the map does not draw.
    #[error("{path}: `payload-killed` names robot {robot}, but the map draws robots 1 to {robots}")]
    NoSuchRobot {
        /// Which file.
        path: String,
        /// The robot.
        robot: u8,
        /// Robots on the map.
        robots: usize,
    },
}

/// A side of the map.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Facing {
    North,
    East,
    South,
    West,
}

/// The process of a payload ends.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct PayloadKilled {
    robot: u8,
    at_s: u64,
    /// Whether it is started again.
    restarts: bool,
}

/// What is expected at the end.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Expected {
    /// The seed's outcome, in words.
    seed: String,
    /// Steps from each robot to the intruder, by id.
    steps: Option<Vec<u32>>,
    /// Steps from all robots to the intruder, the least first.
    steps_in_order: Option<Vec<u32>>,
    /// Longest time from the last promise's deadline to control-off, ms.
    control_off_ms: Option<u64>,
    /// Longest time from the payload's death until it has control again, ms.
    control_on_ms: Option<u64>,
    /// Least way that the wormhole drives after the payload's death, metres.
    drives_itself_m: Option<f64>,
}

/// A file's scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Scene {
    map: String,
    facing: Facing,
    seconds: u64,
    /// Whether robots act together; the seed's plan each for itself.
    coordination: bool,
    payload_killed: Option<PayloadKilled>,
    expected: Expected,
}

/// A scene with its map.
#[derive(Clone, Debug)]
pub struct Scenario {
    scene: Scene,
    map: String,
}

/// What became of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The seed's outcome.
    pub seed: String,
    /// What happened here, a line each.
    pub ours: Vec<String>,
    /// What is not as expected; empty: all is.
    pub wrong: Vec<String>,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", if self.wrong.is_empty() { "as expected" } else { "NOT as expected" })?;
        self.wrong.iter().try_for_each(|line| writeln!(f, "  wrong: {line}"))?;
        writeln!(f, "  seed:  {}", self.seed)?;
        self.ours.iter().try_for_each(|line| writeln!(f, "  ours:  {line}"))
    }
}

impl Scenario {
    /// Reads a file, and the map that it names.
    ///
    /// # Errors
    /// A file cannot be read, or says something else.
    pub fn read(path: &Path) -> Result<Self, NoScenario> {
        let told = path.display().to_string();
        let text = |path: &Path| {
            let file = |error| NoScenario::File { path: path.display().to_string(), error };
            std::fs::read_to_string(path).map_err(file)
        };
        let scene: Scene =
            toml::from_str(&text(path)?).map_err(|error| NoScenario::Toml { path: told.clone(), error })?;
        let map = text(&path.with_file_name(&scene.map))?;
        let robots = map.bytes().filter(|byte| *byte == b'R').count();
        match scene.payload_killed {
            Some(PayloadKilled { robot, .. }) if robot == 0 || usize::from(robot) > robots => {
                Err(NoScenario::NoSuchRobot { path: told, robot, robots })
            }
            _ => Ok(Self { scene, map }),
        }
    }

    /// Runs it.
    pub fn run(&self, seed: u64) -> Verdict {
        let facing = match self.scene.facing {
            Facing::North => Direction::North,
            Facing::East => Direction::East,
            Facing::South => Direction::South,
            Facing::West => Direction::West,
        };
        let mut settings = Settings::default();
        settings.coordination = settings.coordination.filter(|_| self.scene.coordination);
        let mut world = drawn(&self.map, facing, settings, seed);
        let killed = self.scene.payload_killed.and_then(|it| Some((RobotId::new(it.robot)?, it)));
        if let Some((robot, PayloadKilled { at_s, restarts, .. })) = killed {
            world.run_until(at_s * S_NS);
            world.set_restarts(robot, restarts);
            world.kill_payload(robot);
            world.run_until((at_s + 1) * S_NS);
        }
        let place = |world: &World| Some(world.arena.moment(killed?.0)?.pose);
        let before = place(&world);
        world.run_until(self.scene.seconds * S_NS);
        let driven = before.zip(place(&world));
        let driven_m = driven.map(|(one, other)| (one.x_m - other.x_m).hypot(one.y_m - other.y_m));
        let expected = &self.scene.expected;
        let mut verdict = Verdict { seed: expected.seed.clone(), ours: Vec::new(), wrong: Vec::new() };
        verdict.referee(&world);
        if let Some(steps) = &expected.steps {
            verdict.steps(&world, steps, false);
        }
        if let Some(steps) = &expected.steps_in_order {
            verdict.steps(&world, steps, true);
        }
        if let Some((robot, PayloadKilled { at_s, .. })) = killed {
            verdict.control(&world, robot, at_s * S_NS, expected);
        }
        if let (Some(least_m), Some(driven_m)) = (expected.drives_itself_m, driven_m) {
            verdict.check(driven_m >= least_m, format!("the wormhole drives {driven_m:.1} m, at least {least_m}"));
        }
        verdict
    }
}

impl Verdict {
    fn check(&mut self, is_right: bool, line: String) {
        if is_right { self.ours.push(line) } else { self.wrong.push(line) }
    }

    fn referee(&mut self, world: &World) {
        let referee = world.arena.referee();
        let touches = referee.touches_towards();
        self.check(touches == 0, format!("{touches} touches by a robot that moved towards what it touched"));
        let two = referee.two_in_cell();
        self.check(two == 0, format!("{two} times two robots in a cell"));
        let mistakes = world.mistakes().len();
        self.check(mistakes == 0, format!("{mistakes} friends taken for intruders"));
    }

    fn steps(&mut self, world: &World, expected: &[u32], in_order: bool) {
        let mut steps: Vec<u32> = steps_to_intruder(world).into_values().collect();
        if in_order {
            steps.sort_unstable();
        }
        let payloads = world.alive().filter_map(|id| world.payload(id));
        let block = payloads.filter(|payload| payload.mode() == Mode::Blocking).count();
        self.check(block == expected.len(), format!("{block} robots block"));
        self.check(steps == expected, format!("steps to the intruder: {steps:?}, expected {expected:?}"));
    }

    fn control(&mut self, world: &World, robot: RobotId, killed_ns: u64, expected: &Expected) {
        let since_ms = |has: bool| {
            let mut changes = world.control(robot).iter().filter(|(at_ns, on)| *at_ns >= killed_ns && *on == has);
            changes.next().map(|(at_ns, _)| (at_ns - killed_ns) / 1_000_000)
        };
        for (has, word, limit_ms) in [(false, "off", expected.control_off_ms), (true, "on", expected.control_on_ms)] {
            let Some(limit_ms) = limit_ms else { continue };
            match since_ms(has) {
                Some(ms) => {
                    self.check(ms <= limit_ms, format!("control {word} {ms} ms after the death, at most {limit_ms}"))
                }
                None => self.wrong.push(format!("control never {word}, expected within {limit_ms} ms")),
            }
        }
    }
}
