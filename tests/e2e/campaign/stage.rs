//! The robot of a campaign: the arena, out of reach of every fault, and the launch that is attacked.

use super::fault::{Fault, Plan, Victim, below};
use crate::harness::{Place, Robot, halt, lab, repository, signal, wait};
use crate::network::{NETWORK, Network, nodes};
use crate::process::{Running, Said};
use crate::set_clock::WallClock;
use nix::sys::signal::Signal;
use rohrpost_builtin::{Report, Touch};
use rohrpost_config::Installation;
use std::time::{Duration, Instant};

/// A process starts, joins and hears its first scan within this time, stated for a computer with other work.
const START: Duration = Duration::from_secs(4);
/// Routers renew sessions and subscriptions within this time.
const ROUTERS: Duration = Duration::from_secs(3);

/// The arena moves the robot in such steps.
pub(super) const PHYSICS_STEP: Duration = Duration::from_millis(10);

/// Whether the wormhole stands between program and motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Supervision {
    Wormhole,
    Bare,
}

/// The times of the configuration, from which the bounds follow.
pub(super) struct Times {
    pub(super) promise: Duration,
    pub(super) horizon: Duration,
    pub(super) wait: Duration,
    /// From one look at the command in effect to the next, lateness included.
    pub(super) look: Duration,
    pub(super) late: Duration,
    pub(super) scan_age: Duration,
    pub(super) scan_period: Duration,
    pub(super) dead_man: Duration,
    pub(super) watchdog: Duration,
    /// Before a process is started again: the longest, since each pause is twice the one before.
    pub(super) pause: Duration,
    pub(super) start: Duration,
    /// Until routers that lost each other pass packages again.
    pub(super) routers: Duration,
}

impl Times {
    fn of(installation: &Installation) -> Self {
        let module = |name: &str| {
            let name = installation.classes.parse_module(name).unwrap();
            installation.module(name).unwrap_or_else(|| panic!("no {name:?}"))
        };
        let number = |of: &str, key: &str| {
            let value = module(of).settings.get(key).unwrap_or_else(|| panic!("{of} has no `{key}`"));
            value.as_integer().unwrap() as u64
        };
        let ms = |key: &str| Duration::from_millis(number("wormhole.0", key));
        let program = module("pilot.0");
        Self {
            promise: ms("promise-ms"),
            horizon: ms("horizon-ms"),
            wait: ms("wait-ms"),
            look: ms("look-ms") + ms("late-ms"),
            late: ms("late-ms"),
            scan_age: ms("scan-age-max-ms"),
            scan_period: Duration::from_secs(1) / number("motor.1", "laser-rate-hz") as u32,
            dead_man: Duration::from_millis(number("motor.1", "dead-man-ms")),
            watchdog: program.watchdog.unwrap().limit,
            pause: 4 * program.restart.backoff,
            start: START,
            routers: ROUTERS,
        }
    }
}

/// What the referee wrote.
pub(super) struct Refereed {
    pub(super) report: Report,
    pub(super) touches: Vec<Touch>,
    /// Whether the arena's exit code says that nothing counts against the robot.
    pub(super) is_clean: bool,
}

/// The nodes of a robot on two computers: body and wormhole, and the program.
const NODES: [(&str, &str); 2] = [("base", "10.79.0.1"), ("brain", "10.79.0.2")];

pub(super) struct Stage {
    // Dropped in this order.
    pub(super) network: Network,
    arena: Running,
    clock: Option<WallClock>,
    supervision: Supervision,
    /// Computers of the body and of the program.
    nodes: [&'static str; 2],
}

impl Stage {
    /// Starts the arena, then the robot in it; none, with a report, where namespaces are needed and not permitted.
    pub(super) fn begin(plan: &mut Plan, supervision: Supervision) -> Option<Self> {
        let is_divided = plan.has(Victim::Network);
        let lab = if is_divided { Some(lab(NODES, "a campaign of several nodes")?) } else { None };
        let place = Place::new();
        place.write("building.map", map(plan));
        let text = configuration(plan.seed, supervision);
        let config = place.write("robot.toml", if is_divided { divided(&text) } else { text });
        let mut arena = place.start(&["arena", config.to_str().unwrap(), "--touches", "touches.jsonl"]);
        arena.wait_for("the arena is open");
        let clock = plan.has(Victim::Clock).then(|| WallClock::new(&place));
        let mut network = Network::new(place, config.clone(), lab);
        network.environment.extend(clock.iter().flat_map(WallClock::environment));
        let nodes = if is_divided { NODES.map(|(name, _)| name) } else { ["main"; 2] };
        network.launch_from(&config, if is_divided { &nodes } else { &nodes[..1] });
        Some(Self { network, arena, clock, supervision, nodes })
    }

    /// The computer of body and wormhole.
    pub(super) fn base(&self) -> &Robot {
        self.network.robot(self.nodes[0])
    }

    fn brain(&self) -> &Robot {
        self.network.robot(self.nodes[1])
    }

    pub(super) fn times(&self) -> Times {
        Times::of(&self.base().installation)
    }

    fn body(&self) -> &'static str {
        if self.supervision == Supervision::Bare { "motor.0" } else { "motor.1" }
    }

    /// Lets a fault happen, and returns when it has.
    pub(super) fn inject(&mut self, fault: Fault) {
        match fault {
            Fault::ProgramKilled => signal(self.brain().pid("pilot.0"), Signal::SIGKILL),
            Fault::ProgramStopped => halt(self.brain().pid("pilot.0")),
            Fault::Mischief(how) => drop(self.set("pilot.0", "mischief", how).ok()),
            Fault::Scanner(how) => drop(self.set("odometry.0", "scanner", how).ok()),
            Fault::BodyKilled => signal(self.base().pid(self.body()), Signal::SIGKILL),
            Fault::BodyStopped => halt(self.base().pid(self.body())),
            Fault::WormholeKilled if self.supervision == Supervision::Wormhole => {
                signal(self.base().pid("wormhole.0"), Signal::SIGKILL);
            }
            Fault::WormholeStopped if self.supervision == Supervision::Wormhole => halt(self.base().pid("wormhole.0")),
            Fault::WormholeKilled | Fault::WormholeStopped => {}
            Fault::ClockSet(by_s) => self.clock.as_ref().unwrap().set(by_s),
            Fault::LaunchKilled => self.network.kill(self.nodes[0], false),
            Fault::RouterKilled(at) => {
                signal(self.network.robot(self.nodes[at]).pid(&format!("router.{at}")), Signal::SIGKILL);
            }
            Fault::NodeKilled => self.network.kill(self.nodes[1], true),
            Fault::LinkCut => self.network.lab().cut(self.nodes[1]).unwrap(),
        }
    }

    /// Takes away its cause, if supervision has not; since when it is gone. A scanner works again once its module says
    /// so: how long a person's command takes to start is no time of the robot's.
    pub(super) fn repair(&mut self, fault: Fault) -> Instant {
        let since = Instant::now();
        match fault {
            // The process may be another one by now, which does what it should.
            Fault::Mischief(_) => drop(self.set("pilot.0", "mischief", "nothing")),
            Fault::Scanner(_) => {
                self.set("odometry.0", "scanner", "works").ok();
                return Instant::now();
            }
            Fault::BodyStopped => self.go_on(self.body()),
            Fault::WormholeStopped => self.go_on("wormhole.0"),
            Fault::LaunchKilled => self.network.launch(self.nodes[0]),
            Fault::NodeKilled => self.network.launch(self.nodes[1]),
            Fault::LinkCut => self.network.lab().fix(self.nodes[1]).unwrap(),
            _ => {}
        }
        since
    }

    fn go_on(&self, module: &str) {
        if let Some(process) = self.base().process(module) {
            signal(process.pid, Signal::SIGCONT);
        }
    }

    fn set(&self, module: &str, parameter: &str, to: &str) -> Said {
        let config = self.network.config.to_str().unwrap();
        let node = if module == "pilot.0" { self.nodes[1] } else { self.nodes[0] };
        self.network.place.say(&["param", "set", "--config", config, "--node", node, module, parameter, to])
    }

    /// Lines of launch that say that the program is started again; none of a launch that is dead.
    pub(super) fn restarted(&self) -> Vec<String> {
        let again = |line: &&str| line.starts_with("pilot.0 ") && line.contains("starts again in");
        let launch = self.network.nodes.iter().find(|(name, ..)| *name == self.nodes[1]);
        let out = launch.map(|(_, launch, _)| launch.out()).unwrap_or_default();
        out.lines().filter(again).map(str::to_owned).collect()
    }

    /// Ends the robot, then the arena; what the referee wrote.
    pub(super) fn end(mut self) -> Refereed {
        while let Some((_, mut launch, _)) = self.network.nodes.pop() {
            // It says so by its exit code if a module failed on the way.
            launch.signal(Signal::SIGINT);
            launch.end();
        }
        self.network.place.assert_empty();
        self.arena.assert_runs();
        self.arena.signal(Signal::SIGINT);
        let is_clean = self.arena.end().success();
        let text = std::fs::read_to_string(self.network.place.path("touches.jsonl")).unwrap();
        let mut lines: Vec<&str> = text.lines().collect();
        let report = serde_json::from_str(lines.pop().unwrap()).unwrap();
        let touches = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        Refereed { report, touches, is_clean }
    }
}

/// Squares around the robot that are free, and how far ahead a wall is, squares of 0.2 m.
const ROOM: usize = 3;
const WALL: [usize; 2] = [5, 11];

/// The demo's building with the robot in front of a wall of it.
fn map(plan: &mut Plan) -> String {
    let text = std::fs::read_to_string(repository("config/building.map")).unwrap();
    let (head, rows) = text.split_once("map\n").unwrap();
    let mut rows: Vec<Vec<u8>> = rows.replace('>', " ").lines().map(|row| row.as_bytes().to_vec()).collect();
    let margin = WALL[1];
    let [height, width] = [rows.len(), rows[0].len()].map(|end| (end - 2 * margin) as u64);
    let (row, column, heading) = wait("a place with room", || {
        let mut at = |end| margin + below(&mut plan.random, end) as usize;
        let (row, column) = (at(height), at(width));
        let around = rows[row - ROOM..=row + ROOM].iter().flat_map(|row| &row[column - ROOM..=column + ROOM]);
        let has_room = around.copied().all(|square| square == b' ');
        let heading = [b'>', b'<', b'^', b'v'][below(&mut plan.random, 4) as usize];
        let ahead = |squares: usize| match heading {
            b'>' => rows[row][column + squares],
            b'<' => rows[row][column - squares],
            b'^' => rows[row - squares][column],
            _ => rows[row + squares][column],
        };
        (has_room && (WALL[0]..=WALL[1]).any(|squares| ahead(squares) == b'#')).then_some((row, column, heading))
    });
    rows[row][column] = heading;
    let rows: Vec<String> = rows.into_iter().map(|row| String::from_utf8(row).unwrap()).collect();
    format!("{head}map\n{}\n", rows.join("\n"))
}

/// `config/demo-supervised.toml` with its robot in an arena, and a program that misbehaves when it is told to.
fn configuration(seed: u64, supervision: Supervision) -> String {
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let (common, pilot) = text.split_once("[[module]]\nname = \"pilot.0\"").unwrap();
    assert!(pilot.starts_with("\nbuiltin = \"pilot\""));
    let (robot, wormhole) = common.split_once("[[module]]\nname = \"wormhole.0\"").unwrap();
    let mut robot = robot.to_owned();
    let mut replace = |from: &str, to: &str| {
        assert!(robot.contains(from), "{from}");
        robot = robot.replace(from, to);
    };
    replace("[nodes.main]", "[nodes.main]\n[time]\nwhen-set = \"new-epoch\"");
    replace("map = \"building.map\"", "map = \"building.map\", arena = \"arena.sock\"");
    let (rest, called, wormhole) = match supervision {
        Supervision::Wormhole => {
            let times = "promise-ms = 300\nhorizon-ms = 1000\nwait-ms = 1500\nscan-age-max-ms = 300\nlook-ms = 50\n";
            let rest = format!("[[module]]\nname = \"wormhole.0\"{wormhole}{times}");
            (rest, "\"laser.0\", \"motor.0\", \"wormhole.0\"", ", wormhole = \"wormhole.0\"")
        }
        Supervision::Bare => {
            replace("[access]\nmotor = [\"pilot\", \"tool\"]", "");
            replace("name = \"motor.1\"", "name = \"motor.0\"");
            (String::new(), "\"laser.0\", \"motor.0\"", "")
        }
    };
    format!(
        "{robot}{rest}[[module]]\nname = \"pilot.0\"\nbuiltin = \"mischief\"\ncalls = [{called}]\nwatchdog = \"2 s\"\n\
         restart = {{ backoff = \"100 ms\" }}\n\
         settings = {{ laser = \"laser.0\", motor = \"motor.0\", seed = {seed}{wormhole} }}\n"
    )
}

/// The robot with its program on another computer.
fn divided(text: &str) -> String {
    let replace = |text: String, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let text = replace(text.to_owned(), "[nodes.main]\n[time]\n", &(nodes(NODES) + NETWORK));
    let text = replace(text, "motor = { id", "router = { id = 250 }\nmotor = { id");
    let text = replace(text, "[[module]]\n", "[[module]]\nnode = \"base\"\n");
    replace(text, "node = \"base\"\nname = \"pilot.0\"", "node = \"brain\"\nname = \"pilot.0\"")
}
