//! Robots on the air, in virtual time.

use crate::robots::{BEAT_NS, Robot};
use rohrpost_team::{Position, RobotId};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::events::Events;
use rohrpost_testbed::sim::link::Quality;
use rohrpost_testbed::sim::radio::{Place, Radio};
use std::collections::BTreeMap;

pub(crate) const RANGE_MM: u64 = 100_000;

pub(crate) enum Event {
    /// Of this run of the robot.
    Beat(RobotId, u32),
    Arrive(RobotId, Vec<u8>),
}

/// Robots of both kinds on the air.
pub(crate) struct World {
    /// True time: each robot has a clock of its own, see [`clock_ns`].
    pub(crate) now_ns: u64,
    pub(crate) chance: Chance,
    pub(crate) robots: BTreeMap<RobotId, Robot>,
    runs: BTreeMap<RobotId, u32>,
    pub(crate) radio: Radio<RobotId>,
    events: Events<Event>,
    /// Messages so far.
    pub(crate) hellos: u32,
    pub(crate) records: u32,
    /// Of places at which something was seen.
    pub(crate) number: i32,
}

pub(crate) fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

/// Clocks of robots are 13 days apart, from id to id.
pub(crate) fn clock_ns(id: RobotId, now_ns: u64) -> u64 {
    now_ns + (u64::from(id.get()) << 50)
}

impl World {
    pub(crate) fn new(seed: u64, loss_ppm: u32) -> Self {
        let (reorder_ppm, damage_ppm, rate_bytes_s) = (10_000, 0, 0);
        let (delay_ns, jitter_ns) = (1_000_000, 19_000_000);
        let quality =
            Quality { delay_ns, jitter_ns, loss_ppm, copy_ppm: 10_000, reorder_ppm, damage_ppm, rate_bytes_s };
        let (robots, runs, events) = (BTreeMap::new(), BTreeMap::new(), Events::default());
        let (chance, radio) = (Chance::new(seed), Radio::new(RANGE_MM, quality));
        Self { now_ns: 0, chance, robots, runs, radio, events, hellos: 0, records: 0, number: 0 }
    }

    pub(crate) fn add(&mut self, id: RobotId, robot: Robot, x_mm: i32) {
        self.robots.insert(id, robot);
        self.radio.put(id, Place { x_mm, y_mm: 0 });
        let run = self.runs.entry(id).or_insert(0);
        *run += 1;
        self.events.push(self.now_ns + self.chance.below(BEAT_NS), Event::Beat(id, *run));
    }

    /// The robot does not beat any more.
    pub(crate) fn kill(&mut self, id: RobotId) {
        self.robots.remove(&id);
        self.radio.remove(id);
    }

    pub(crate) fn run_beats(&mut self, beats: u64) {
        let end_ns = self.now_ns + beats * BEAT_NS;
        while let Some((at_ns, event)) = self.events.pop() {
            if at_ns > end_ns {
                self.events.push(at_ns, event);
                break;
            }
            self.now_ns = at_ns;
            match event {
                Event::Beat(id, run) if self.runs[&id] == run => self.beat(id, run),
                Event::Beat(..) => {}
                Event::Arrive(id, bytes) => {
                    if let Some(robot) = self.robots.get_mut(&id) {
                        robot.hear(clock_ns(id, at_ns), &bytes);
                    }
                }
            }
        }
        self.now_ns = end_ns;
    }

    pub(crate) fn beat(&mut self, id: RobotId, run: u32) {
        let Some(robot) = self.robots.get_mut(&id) else { return };
        let messages = robot.beat(clock_ns(id, self.now_ns));
        self.hellos += 1;
        self.records += messages.len() as u32 - 1;
        for bytes in messages {
            for (to, at_ns) in self.radio.send(self.now_ns, id, bytes.len(), &mut self.chance) {
                self.events.push(at_ns, Event::Arrive(to, bytes.clone()));
            }
        }
        self.events.push(self.now_ns + BEAT_NS, Event::Beat(id, run));
    }

    pub(crate) fn see(&mut self, id: RobotId, y_mm: i32) {
        let place = Position { x_mm: i32::from(id.get()) * 1000, y_mm };
        self.robots.get_mut(&id).unwrap().see(clock_ns(id, self.now_ns), place);
    }

    /// All have this pair, this many objects (those in Rust tell them), and know that all have them.
    pub(crate) fn assert_agreed(&mut self, pair: (u8, u8), objects: usize, why: &str) {
        let mut digests = None;
        for (id, robot) in &mut self.robots {
            let known = robot.known(clock_ns(*id, self.now_ns));
            assert_eq!(known.pair, pair, "{why}: {id}");
            assert!(known.agrees, "{why}: {id} does not know that views are equal: {known:?}");
            assert_eq!(*digests.get_or_insert_with(|| known.digests.clone()), known.digests, "{why}: {id}");
            if let Robot::Rust(team) = robot {
                assert_eq!(team.view().objects().len(), objects, "{why}: {id}");
            }
        }
    }
}
