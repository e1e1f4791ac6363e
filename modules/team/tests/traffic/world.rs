//! Bodies on a map, each with its core, and the radio between them.

use rohrpost_team::RobotId;
use rohrpost_team::coordination::{Planner, Target, Traffic, TrafficMessage, TrafficSettings};
use rohrpost_team::grid::{Cell, Grid, Map};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::events::Events;
use std::collections::BTreeMap;

pub(crate) const MS_NS: u64 = 1_000_000;
pub(crate) const S_NS: u64 = 1000 * MS_NS;
/// Between two looks of a robot.
const TICK_NS: u64 = 50 * MS_NS;
pub(crate) const MAP: u64 = 7;

pub(crate) const SETTINGS: TrafficSettings = TrafficSettings {
    beat_ns: 500 * MS_NS,
    max_age_ns: 4 * S_NS,
    forget_ns: 3600 * S_NS,
    delay_max_ns: 100 * MS_NS,
    step_min_ns: 400 * MS_NS,
    claim_ns: 3 * S_NS,
    stall_ns: 5 * S_NS,
    agree_ns: 5 * S_NS,
    extend_ns: S_NS,
    looks_max: 500,
};

pub(crate) fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

pub(crate) fn grid(text: &str) -> Grid {
    Map::read(text.as_bytes()).unwrap().grid
}

pub(crate) fn cell(text: &str) -> Cell {
    text.parse().unwrap()
}

enum Event {
    Tick(RobotId),
    Arrive { to: RobotId, bytes: Vec<u8> },
}

/// A robot and where it truly is.
pub(crate) struct Body {
    pub(crate) traffic: Traffic,
    pub(crate) cell: Cell,
    /// The cell that it drives to, and when it is there.
    going: Option<(Cell, u64)>,
    pub(crate) is_alive: bool,
    /// Robots are in reach of each other if their parts are equal.
    pub(crate) part: u8,
    /// When the last message of each other robot came.
    heard_ns: BTreeMap<RobotId, u64>,
    incarnation: u32,
    steps: u32,
}

pub(crate) struct World {
    planner: Planner,
    pub(crate) now_ns: u64,
    pub(crate) chance: Chance,
    pub(crate) bodies: BTreeMap<RobotId, Body>,
    pub(crate) loss_percent: u64,
    pub(crate) settings: TrafficSettings,
    /// When a robot began a step last.
    pub(crate) moved_ns: u64,
    /// Two that hear each other, in one cell.
    pub(crate) faults: Vec<String>,
    events: Events<Event>,
}

impl World {
    pub(crate) fn new(seed: u64, grid: Grid) -> Self {
        let (bodies, events) = (BTreeMap::new(), Events::default());
        let (faults, chance) = (Vec::new(), Chance::new(seed));
        let (settings, planner) = (SETTINGS, Planner::new(grid));
        Self { planner, now_ns: 0, chance, bodies, loss_percent: 0, settings, moved_ns: 0, faults, events }
    }

    pub(crate) fn add(&mut self, system: u8, at: Cell, goal: Option<Cell>) {
        let mut traffic = Traffic::new(id(system), 1, MAP, self.settings, self.now_ns);
        traffic.set_place(Some(at));
        traffic.set_goal(goal);
        let heard_ns = BTreeMap::new();
        let body = Body { traffic, cell: at, going: None, is_alive: true, part: 0, heard_ns, incarnation: 1, steps: 0 };
        self.bodies.insert(id(system), body);
        self.events.push(self.now_ns + self.chance.below(TICK_NS), Event::Tick(id(system)));
    }

    pub(crate) fn body(&mut self, system: u8) -> &mut Body {
        self.bodies.get_mut(&id(system)).unwrap()
    }

    /// A robot that was dead starts again where it is.
    pub(crate) fn restart(&mut self, robot: RobotId, goal: Option<Cell>) {
        let now_ns = self.now_ns;
        let body = self.bodies.get_mut(&robot).unwrap();
        body.incarnation += 1;
        body.traffic = Traffic::new(robot, body.incarnation, MAP, self.settings, now_ns);
        body.traffic.set_place(Some(body.cell));
        body.traffic.set_goal(goal);
        body.going = None;
        body.is_alive = true;
        body.heard_ns.clear();
    }

    /// A robot stops, and does not know its cell any more.
    pub(crate) fn lose(&mut self, system: u8) {
        let body = self.body(system);
        body.going = None;
        body.traffic.set_place(None);
    }

    pub(crate) fn see(&mut self, intruders: &[Target]) {
        self.bodies.values_mut().for_each(|body| body.traffic.set_intruders(intruders.to_vec()));
    }

    pub(crate) fn run(&mut self, duration_ns: u64) {
        let end_ns = self.now_ns + duration_ns;
        while let Some((at_ns, event)) = self.events.pop() {
            if at_ns > end_ns {
                self.events.push(at_ns, event);
                break;
            }
            self.now_ns = at_ns;
            match event {
                Event::Tick(robot) => {
                    self.tick(robot);
                    self.events.push(at_ns + TICK_NS, Event::Tick(robot));
                }
                Event::Arrive { to, bytes } => self.arrive(to, &bytes),
            }
        }
        self.now_ns = end_ns;
    }

    fn arrive(&mut self, to: RobotId, bytes: &[u8]) {
        let message = TrafficMessage::decode(bytes).unwrap();
        let Some(body) = self.bodies.get_mut(&to).filter(|body| body.is_alive) else { return };
        body.heard_ns.insert(message.from, self.now_ns);
        body.traffic.hear(self.now_ns, &message);
        self.poll(to);
    }

    fn tick(&mut self, robot: RobotId) {
        let body = self.bodies.get_mut(&robot).unwrap();
        if !body.is_alive {
            return;
        }
        if let Some((to, _)) = body.going.filter(|(_, at_ns)| *at_ns <= self.now_ns) {
            (body.cell, body.going) = (to, None);
            body.traffic.set_place(Some(to));
        }
        self.poll(robot);
    }

    fn poll(&mut self, robot: RobotId) {
        let body = self.bodies.get_mut(&robot).unwrap();
        let message = body.traffic.poll(self.now_ns, &mut self.planner);
        let goes_to = body.traffic.next_cell().filter(|_| body.going.is_none());
        if let Some(message) = message {
            self.send(robot, &message);
        }
        if let Some(to) = goes_to {
            self.begin_step(robot, to);
        }
    }

    fn send(&mut self, from: RobotId, message: &TrafficMessage) {
        let part = self.bodies[&from].part;
        let bytes = message.encode();
        let others: Vec<RobotId> = self.bodies.keys().copied().filter(|robot| *robot != from).collect();
        for to in others {
            if self.bodies[&to].part == part && !self.chance.percent(self.loss_percent) {
                let delay_ns = self.chance.between(MS_NS, SETTINGS.delay_max_ns - MS_NS);
                self.events.push(self.now_ns + delay_ns, Event::Arrive { to, bytes: bytes.clone() });
            }
        }
    }

    /// A robot drives into a cell. If another body is there, and each has heard the other one, that is a fault; if not,
    /// its sensors hold it.
    fn begin_step(&mut self, robot: RobotId, to: Cell) {
        let hears = |me: RobotId, other: RobotId| {
            let heard_ns = self.bodies[&me].heard_ns.get(&other);
            heard_ns.is_some_and(|heard_ns| self.now_ns - heard_ns <= SETTINGS.max_age_ns)
        };
        let is_in_it = |body: &Body| body.cell == to || body.going.is_some_and(|(going, _)| going == to);
        let other = self.bodies.iter().find(|(other, body)| **other != robot && is_in_it(body));
        if let Some((other, body)) = other {
            if hears(robot, *other) && (hears(*other, robot) || !body.is_alive) {
                self.faults.push(format!("{robot} enters {to}, where {other} is, at {} ms", self.now_ns / MS_NS));
            }
            self.bodies.get_mut(&robot).unwrap().traffic.turned_back();
            return;
        }
        let step_ns = self.chance.between(SETTINGS.step_min_ns, 3 * SETTINGS.step_min_ns);
        let body = self.bodies.get_mut(&robot).unwrap();
        body.going = Some((to, self.now_ns + step_ns));
        body.steps += 1;
        self.moved_ns = self.now_ns;
    }

    /// Runs until a condition holds; how long that takes, ns. Robots that are not there yet stand no longer than ten
    /// seconds.
    pub(crate) fn run_until(&mut self, most_ns: u64, what: &str, holds: impl Fn(&Self) -> bool) -> u64 {
        let began_ns = self.now_ns;
        self.moved_ns = self.now_ns;
        while !holds(self) {
            self.run(100 * MS_NS);
            let still_ns = self.now_ns - self.moved_ns;
            assert!(still_ns <= 10 * S_NS, "{what}: giving way begins within 10 s; {}", self.told());
            let took_ns = self.now_ns - began_ns;
            assert!(took_ns <= most_ns, "{what}: robots are where they have to be in time; {}", self.told());
        }
        assert!(self.faults.is_empty(), "{what}: no two that hear each other are in a cell: {:?}", self.faults);
        self.now_ns - began_ns
    }

    fn told(&self) -> String {
        let body = |(robot, body): (&RobotId, &Body)| {
            let given_up = body.traffic.given_up();
            format!("{robot} is in {}, going to {:?}, after {} steps, {given_up:?}", body.cell, body.going, body.steps)
        };
        self.bodies.iter().map(body).collect::<Vec<_>>().join("\n")
    }

    /// Whether robots are in these cells, and stand.
    pub(crate) fn are_at(&self, goals: &BTreeMap<RobotId, Cell>) -> bool {
        goals.iter().all(|(robot, goal)| self.bodies[robot].cell == *goal && self.bodies[robot].going.is_none())
    }
}
