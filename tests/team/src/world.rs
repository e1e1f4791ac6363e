//! All robots, the air between them, and what happens next.

mod air;

use crate::guard::Guard;
use crate::robot::Robot;
use crate::standard::{BEAT_NS, GOOD, S_NS, body, limits, team_settings};
use crate::watch::Watch;
use rohrpost_arena::{Arena, ArenaSettings, Conduct};
use rohrpost_modules::types::{Pose, Twist};
use rohrpost_payload::{Ground, News, Payload, Request, RequestId, RequestKind, Sensed, Settings};
use rohrpost_supervision::{Change, Control};
use rohrpost_team::grid::{Cell, Direction, Map};
use rohrpost_team::{RobotId, Run};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::clock::Clock;
use rohrpost_testbed::sim::events::Events;
use rohrpost_testbed::sim::link::Quality;
use rohrpost_testbed::sim::radio::Radio;
use rohrpost_testbed::sim::team_end::TeamEnd;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;

/// From one scan to the next.
const SCAN_NS: u64 = S_NS / 10;
/// A payload that is started again needs so long.
const START_NS: u64 = S_NS;
/// Of clocks of the world, ns a second.
const DRIFT_PPB: i64 = 50_000;
/// Greatest error of a pose, metres and radians.
const POSE_ERROR_M: f64 = 0.02;
const POSE_ERROR_RAD: f64 = 0.005;

enum Happening {
    Scan(RobotId),
    Beat(RobotId, u32),
    Look(RobotId),
    Router(RobotId),
    Start(RobotId, u32),
    Arrive(RobotId, Rc<[u8]>),
}

/// A team in its world.
pub struct World {
    /// True time, ns.
    pub now_ns: u64,
    /// The floor, all bodies and the referee.
    pub arena: Arena,
    /// What decides by chance.
    pub chance: Chance,
    radio: Radio<RobotId>,
    robots: BTreeMap<RobotId, Robot>,
    /// Robots that the others do not hear.
    far: BTreeSet<RobotId>,
    pushed: BTreeSet<RobotId>,
    events: Events<Happening>,
    ground: Arc<Ground>,
    settings: Settings,
    mistakes: Vec<String>,
}

impl World {
    /// A world without robots, of a map with cells of `cell_m` where it does not say their size.
    ///
    /// # Panics
    /// If the text is no map to drive on.
    pub fn new(map: &str, cell_m: f64, settings: Settings, seed: u64) -> Self {
        let ground = Ground::read(map.as_bytes(), Some(cell_m), settings.margin_m).unwrap_or_else(|no| panic!("{no}"));
        let drawn = Map::read(map.as_bytes()).unwrap_or_else(|no| panic!("{no}"));
        let arena =
            ArenaSettings { cell_m: ground.cell_m(), robot: body(seed), intruder_radius_m: settings.intruder_radius_m };
        Self {
            now_ns: 0,
            arena: Arena::new(&drawn, arena).unwrap_or_else(|no| panic!("{no}")),
            chance: Chance::new(seed),
            radio: Radio::new(1_000_000, GOOD),
            robots: BTreeMap::new(),
            far: BTreeSet::new(),
            pushed: BTreeSet::new(),
            events: Events::default(),
            ground: Arc::new(ground),
            settings,
            mistakes: Vec::new(),
        }
    }

    /// From now on all links are so.
    pub fn set_quality(&mut self, quality: Quality) {
        self.radio.set_quality(quality);
    }

    /// A robot that starts in the middle of a cell, with a clock of any time and any phase of its beat.
    ///
    /// # Panics
    /// If no robot can start there.
    pub fn add_robot(&mut self, id: RobotId, cell: Cell, facing: Direction) {
        self.arena.add_robot(id, cell, facing).unwrap_or_else(|no| panic!("{no}"));
        let start_ns = self.chance.below(90 * 365 * 86_400 * S_NS);
        let clock = Clock::new(start_ns, 0, self.chance.around(DRIFT_PPB));
        let limits = limits(&body(0), self.settings.speeds.blocking_m_s);
        let router = TeamEnd::new(id.get(), false, &mut self.chance, clock.at(self.now_ns).monotonic_ns);
        let robot = Robot {
            clock,
            payload: None,
            guard: Guard::new(limits, self.ground.clone()),
            router,
            router_due_ns: u64::MAX,
            incarnation: 0,
            is_dead: false,
            has_no_pose: false,
            restarts: true,
            news: Vec::new(),
            watch: Watch::default(),
            control: Vec::new(),
        };
        self.robots.insert(id, robot);
        self.events.push(self.now_ns + self.chance.below(SCAN_NS), Happening::Scan(id));
        self.start(id);
        self.put_on_air(id);
        self.poll_router(id);
    }

    /// An intruder, in the middle of a cell.
    pub fn add_intruder(&mut self, cell: Cell, conduct: Conduct) {
        self.arena.add_intruder(cell, conduct);
    }

    fn robot(&mut self, id: RobotId) -> &mut Robot {
        self.robots.get_mut(&id).unwrap_or_else(|| panic!("robot {id} is not in this world"))
    }

    /// The payload of a robot, as long as its process is there.
    pub fn payload(&self, id: RobotId) -> Option<&Payload> {
        self.robots.get(&id)?.payload.as_ref()
    }

    /// What a robot's clock shows now, ns.
    ///
    /// # Panics
    /// If the robot is not in this world.
    pub fn clock_ns(&self, id: RobotId) -> u64 {
        self.robots[&id].clock_ns(self.now_ns)
    }

    /// What a robot has told people so far, by true time, ns.
    ///
    /// # Panics
    /// If the robot is not in this world.
    pub fn news(&self, id: RobotId) -> &[(u64, News)] {
        &self.robots[&id].news
    }

    /// When a robot's payload gained (true) and lost control, true ns.
    ///
    /// # Panics
    /// If the robot is not in this world.
    pub fn control(&self, id: RobotId) -> &[(u64, bool)] {
        &self.robots[&id].control
    }

    /// Robots that are not switched off.
    pub fn alive(&self) -> impl Iterator<Item = RobotId> {
        self.robots.iter().filter(|(_, robot)| !robot.is_dead).map(|(id, _)| *id)
    }

    /// What happened that must not: friends taken for intruders.
    pub fn mistakes(&self) -> &[String] {
        &self.mistakes
    }

    /// A person at a robot asks something of all that it hears, once. No effect without a payload.
    pub fn ask(&mut self, id: RobotId, kind: RequestKind) {
        let now_ns = self.now_ns;
        let robot = self.robot(id);
        let clock_ns = robot.clock_ns(now_ns);
        let Some(payload) = &mut robot.payload else { return };
        let group = payload.team().group();
        let station = Run { robot: id, incarnation: group.version().incarnation };
        let heard = group.heard(clock_ns).map(|(robot, heard)| (robot, heard.version.incarnation));
        let to = heard.map(|(robot, incarnation)| Run { robot, incarnation }).collect();
        let request_id = RequestId { station, number: (clock_ns / 1_000_000) as u32 };
        payload.ask(clock_ns, Request { id: request_id, kind, to });
        self.serve(id);
    }

    /// The process of a payload ends, with all that it knew.
    pub fn kill_payload(&mut self, id: RobotId) {
        self.robot(id).payload = None;
    }

    /// Whether a payload that keeps no promise is started again.
    pub fn set_restarts(&mut self, id: RobotId, restarts: bool) {
        self.robot(id).restarts = restarts;
    }

    /// A robot is switched off where it is.
    pub fn kill_robot(&mut self, id: RobotId) {
        let robot = self.robot(id);
        (robot.is_dead, robot.payload) = (true, None);
        self.radio.remove(id);
    }

    /// Whether a robot's pose comes from now on.
    pub fn set_pose_comes(&mut self, id: RobotId, comes: bool) {
        self.robot(id).has_no_pose = !comes;
    }

    /// A person puts a robot elsewhere.
    ///
    /// # Panics
    /// If that is no path.
    pub fn push(&mut self, id: RobotId, cell: Cell) {
        self.arena.push(id, cell).unwrap_or_else(|no| panic!("{no}"));
        self.pushed.insert(id);
    }

    /// The payload's process begins.
    fn start(&mut self, id: RobotId) {
        let (now_ns, ground, settings) = (self.now_ns, self.ground.clone(), self.settings.clone());
        let (team, seed, phase_ns) = (team_settings(&settings), self.chance.bits(), self.chance.below(BEAT_NS));
        let robot = self.robot(id);
        robot.incarnation += 1;
        robot.watch = Watch::default();
        let clock_ns = robot.clock_ns(now_ns);
        let payload = Payload::new(clock_ns, id, robot.incarnation, ground, settings, team, seed);
        robot.payload = Some(payload.unwrap_or_else(|refused| panic!("{refused}")));
        let run = robot.incarnation;
        self.events.push(now_ns + phase_ns, Happening::Beat(id, run));
    }

    /// Lets everything happen up to a time.
    pub fn run_until(&mut self, end_ns: u64) {
        while let Some((at_ns, happening)) = self.events.pop() {
            if at_ns > end_ns {
                self.events.push(at_ns, happening);
                break;
            }
            self.now_ns = at_ns;
            match happening {
                Happening::Scan(id) => self.scan(id),
                Happening::Beat(id, run) => self.beat(id, run),
                Happening::Look(id) => self.look(id),
                Happening::Router(id) => self.poll_router(id),
                Happening::Start(id, run) => {
                    let robot = self.robot(id);
                    if !robot.is_dead && robot.payload.is_none() && robot.incarnation == run {
                        self.start(id);
                    }
                }
                Happening::Arrive(id, bytes) => self.arrive(id, &bytes),
            }
        }
        self.now_ns = end_ns;
        self.arena.step_to(end_ns);
    }

    /// Lets so many seconds pass.
    pub fn run_s(&mut self, seconds: u64) {
        self.run_until(self.now_ns + seconds * S_NS);
    }

    /// Runs until a condition holds, looked at four times a second; `None` if it never does in so many seconds.
    pub fn run_until_holds(&mut self, seconds_max: u64, condition: impl Fn(&Self) -> bool) -> Option<u64> {
        let end_ns = self.now_ns + seconds_max * S_NS;
        while self.now_ns < end_ns {
            if condition(self) {
                return Some(self.now_ns);
            }
            self.run_until(self.now_ns + S_NS / 4);
        }
        condition(self).then_some(self.now_ns)
    }

    fn scan(&mut self, id: RobotId) {
        self.arena.step_to(self.now_ns);
        if self.robot(id).is_dead {
            return;
        }
        self.put_on_air(id);
        let (Some(scan), Some(moment)) = (self.arena.scan(id), self.arena.moment(id)) else { return };
        let mut error = |most: f64| most * self.chance.around(1000) as f64 / 1000.0;
        let measured = Pose {
            x_m: moment.pose.x_m + error(POSE_ERROR_M),
            y_m: moment.pose.y_m + error(POSE_ERROR_M),
            heading_rad: moment.pose.heading_rad + error(POSE_ERROR_RAD),
        };
        let (now_ns, taken_ns) = (self.now_ns, self.arena.now_ns());
        let robot = self.robot(id);
        let pose = (!robot.has_no_pose).then_some(measured);
        let (clock_ns, taken_ns) = (robot.clock_ns(now_ns), robot.clock_ns(taken_ns));
        let seen = robot.guard.see(clock_ns, taken_ns, &scan, pose);
        self.follow(id, seen);
        let robot = self.robot(id);
        if let Some(payload) = &mut robot.payload {
            payload.sense(clock_ns, Sensed { pose, speed_m_s: moment.odometry.twist.speed_m_s, scan });
        }
        self.serve(id);
        self.look(id);
        let robot = self.robot(id);
        let next_ns = robot.clock.when(clock_ns + SCAN_NS, now_ns);
        self.events.push(next_ns, Happening::Scan(id));
    }

    fn beat(&mut self, id: RobotId, run: u32) {
        let now_ns = self.now_ns;
        let max_age_ns = team_settings(&self.settings).view.friend_max_age_ns;
        let robot = self.robots.get_mut(&id).unwrap_or_else(|| panic!("robot {id} is not in this world"));
        let clock_ns = robot.clock_ns(now_ns);
        let Some(payload) = robot.payload.as_mut().filter(|_| robot.incarnation == run) else { return };
        payload.beat(clock_ns);
        let mistake = robot.watch.look(&self.arena, payload.team(), clock_ns, max_age_ns);
        if let Some(mistake) = mistake.filter(|mistake| !self.pushed.contains(&mistake.friend)) {
            let seconds = now_ns as f64 * 1e-9;
            self.mistakes.push(format!("{seconds:.2} s: robot {id} takes a friend for an intruder: {mistake}"));
        }
        // As launch's store: a payload that starts again has a higher one.
        robot.incarnation = robot.incarnation.max(payload.team().group().version().incarnation);
        let run = robot.incarnation;
        let next_ns = robot.clock.when(clock_ns + BEAT_NS, now_ns);
        self.events.push(next_ns, Happening::Beat(id, run));
        self.serve(id);
    }

    /// Carries on what a payload has to say: promises, messages, news.
    fn serve(&mut self, id: RobotId) {
        let now_ns = self.now_ns;
        let robot = self.robot(id);
        let clock_ns = robot.clock_ns(now_ns);
        let Some(payload) = &mut robot.payload else { return };
        robot.news.extend(payload.take_news().into_iter().map(|news| (now_ns, news)));
        let messages = payload.take_messages();
        let promise = payload.take_promise();
        let destination_m = payload.destination_m();
        if payload.has_quit() {
            (robot.payload, robot.restarts) = (None, false);
        }
        let change = promise.map(|promise| robot.guard.promise(clock_ns, promise, destination_m));
        let datagrams: Vec<Vec<u8>> = messages.iter().map(|message| robot.router.send(message)).collect();
        datagrams.into_iter().for_each(|datagram| self.send(id, &datagram.into()));
        self.follow(id, change.unwrap_or_default());
    }

    /// The wormhole looks, and the motor is told.
    fn look(&mut self, id: RobotId) {
        let now_ns = self.now_ns;
        self.arena.step_to(now_ns);
        let robot = self.robot(id);
        if robot.is_dead {
            return;
        }
        let clock_ns = robot.clock_ns(now_ns);
        let (command, change) = robot.guard.look(clock_ns);
        if let Some(due_ns) = robot.guard.due_ns() {
            let due_ns = robot.clock.when(due_ns, now_ns);
            // Scans look, too: only what is due before the next one needs a look of its own.
            if due_ns > now_ns && due_ns < now_ns + SCAN_NS {
                self.events.push(due_ns, Happening::Look(id));
            }
        }
        let twist = Twist { speed_m_s: command.speed_m_s, turn_rate_rad_s: command.turn_rate_rad_s };
        self.arena.drive(id, twist).unwrap_or_else(|no| panic!("the envelope lets numbers through alone: {no}"));
        self.follow(id, change);
    }

    /// Notes whether the payload has control; one that keeps no promise is started again.
    fn follow(&mut self, id: RobotId, change: Change) {
        let now_ns = self.now_ns;
        let robot = self.robot(id);
        if let Some(control) = change.control {
            robot.control.push((now_ns, control == Control::On));
        }
        if change.restart.is_some() && robot.restarts {
            robot.payload = None;
            let run = robot.incarnation;
            self.events.push(now_ns + START_NS, Happening::Start(id, run));
        }
    }
}
