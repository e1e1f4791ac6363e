//! Robots at places, with clocks of their own, that hear each other through links with losses and delays.

use rohrpost_team::group::{GroupSettings, Hello, Pose};
use rohrpost_team::view::{Records, ViewSettings};
use rohrpost_team::{Position, RobotId, Team, TeamSettings};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::clock::Clock;
use rohrpost_testbed::sim::events::Events;
use rohrpost_testbed::sim::link::Quality;
use rohrpost_testbed::sim::radio::{Place, Radio};
use rohrpost_testbed::sim::team_end::TeamEnd;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

pub(crate) const BEAT_NS: u64 = 500_000_000;
pub(crate) const MS_NS: u64 = 1_000_000;
/// Longest way of radio, mm.
pub(crate) const RANGE_MM: u64 = 100_000;
/// Of clocks of the world, ns a second; what cores are told of is a little more.
const DRIFT_PPB: i64 = 50_000;

pub(crate) const GOOD: Quality = Quality {
    delay_ns: MS_NS,
    jitter_ns: 19 * MS_NS,
    loss_ppm: 0,
    copy_ppm: 0,
    reorder_ppm: 0,
    damage_ppm: 0,
    rate_bytes_s: 0,
};

/// `max_age` in tenths of a beat.
pub(crate) fn settings(max_age_tenths: u64) -> TeamSettings {
    let view = ViewSettings {
        gate_mm: 500,
        sightings: 1,
        certainty_max_age_ns: 600_000_000_000,
        intruder_max_age_ns: 6_000_000_000_000,
        friend_max_age_ns: 30_000_000_000,
        friend_radius_mm: 300,
        speed_max_mm_s: 1000,
    };
    let group = GroupSettings { beat_ns: BEAT_NS, max_age_ns: max_age_tenths * BEAT_NS / 10 };
    TeamSettings { group, view, drift_ppb: 60_000, clock_off_ns: 1_000_000_000 }
}

pub(crate) fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

/// Seeds of a test, from the environment.
pub(crate) fn seeds() -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().unwrap());
    let first = number("ROHRPOST_TEAM_FIRST").unwrap_or(0);
    first..first + number("ROHRPOST_TEAM_SEEDS").unwrap_or(200)
}

enum Event {
    Beat {
        robot: RobotId,
        run: u32,
    },
    /// The router's own beat may be due.
    Router {
        robot: RobotId,
        run: u32,
    },
    Arrive {
        to: RobotId,
        run: u32,
        bytes: Rc<[u8]>,
    },
}

pub(crate) struct Robot {
    pub(crate) team: Team,
    pub(crate) clock: Clock,
    pub(crate) synchros: u32,
    router: Option<Router>,
    /// Where it died, if it is dead.
    died_at: Option<Place>,
    run: u32,
}

/// What stands between a robot and the air, if anything does.
struct Router {
    end: TeamEnd,
    /// When it is looked at next, true ns.
    due_ns: u64,
}

/// Way from robot to robot.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Way {
    /// Messages as they are.
    Bare,
    /// Datagrams of routers of the team.
    Routed { is_sealed: bool },
}

pub(crate) struct World {
    pub(crate) now_ns: u64,
    pub(crate) chance: Chance,
    pub(crate) robots: BTreeMap<RobotId, Robot>,
    /// Of those that are alive.
    pub(crate) radio: Radio<RobotId>,
    /// Pairs of which the first's hellos do not reach the second; its records do.
    pub(crate) mute: BTreeSet<(RobotId, RobotId)>,
    way: Way,
    settings: TeamSettings,
    events: Events<Event>,
}

impl World {
    pub(crate) fn new(seed: u64, quality: Quality, settings: TeamSettings) -> Self {
        Self {
            now_ns: 0,
            chance: Chance::new(seed),
            robots: BTreeMap::new(),
            radio: Radio::new(RANGE_MM, quality),
            mute: BTreeSet::new(),
            way: Way::Bare,
            settings,
            events: Events::default(),
        }
    }

    /// Robots reach each other so, if none was added yet.
    pub(crate) fn by(self, way: Way) -> Self {
        Self { way, ..self }
    }

    /// A robot with a clock of any time between 1970 and 2060, and any phase of its beat.
    pub(crate) fn add(&mut self, robot: RobotId, x_mm: i32) {
        let start_ns = self.chance.below(90 * 365 * 86_400 * 1_000_000_000);
        let clock = Clock::new(start_ns, 0, self.chance.around(DRIFT_PPB));
        let team = Team::new(robot, 1, 7, self.settings);
        self.robots.insert(robot, Robot { team, clock, synchros: 0, router: None, died_at: None, run: 1 });
        self.move_to(robot, x_mm);
        self.start_router(robot);
        let phase_ns = self.chance.below(BEAT_NS);
        self.events.push(self.now_ns + phase_ns, Event::Beat { robot, run: 1 });
    }

    /// A living robot is elsewhere.
    pub(crate) fn move_to(&mut self, robot: RobotId, x_mm: i32) {
        self.radio.put(robot, Place { x_mm, y_mm: 0 });
    }

    /// A robot dies.
    pub(crate) fn kill(&mut self, robot: RobotId) {
        self.robots.get_mut(&robot).unwrap().died_at = self.radio.remove(robot);
    }

    /// A dead robot starts again, with nothing but its stored incarnation, or with none.
    pub(crate) fn restart(&mut self, robot: RobotId, has_store: bool) {
        let phase_ns = self.chance.below(BEAT_NS);
        let it = self.robots.get_mut(&robot).unwrap();
        let incarnation = if has_store { it.team.group().version().incarnation + 1 } else { 1 };
        it.team = Team::new(robot, incarnation, 7, self.settings);
        it.run += 1;
        self.radio.put(robot, it.died_at.take().unwrap());
        self.events.push(self.now_ns + phase_ns, Event::Beat { robot, run: it.run });
        self.start_router(robot);
    }

    fn start_router(&mut self, robot: RobotId) {
        let Way::Routed { is_sealed } = self.way else { return };
        let clock_ns = self.clock_ns(robot);
        let end = TeamEnd::new(robot.get(), is_sealed, &mut self.chance, clock_ns);
        self.robots.get_mut(&robot).unwrap().router = Some(Router { end, due_ns: u64::MAX });
        self.poll_router(robot);
    }

    /// Sends the router's beat if it is due, and looks again when the next one is.
    fn poll_router(&mut self, id: RobotId) {
        let now_ns = self.now_ns;
        loop {
            let robot = self.robots.get_mut(&id).unwrap();
            let (clock_ns, run) = (robot.clock.at(now_ns).monotonic_ns, robot.run);
            let Some(router) = &mut robot.router else { return };
            match router.end.poll(clock_ns) {
                Ok(datagram) => self.send(id, &datagram.into(), false),
                Err(next_ns) => {
                    let next_ns = robot.clock.when(next_ns, now_ns);
                    if router.due_ns <= now_ns || next_ns < router.due_ns {
                        router.due_ns = next_ns;
                        self.events.push(next_ns, Event::Router { robot: id, run });
                    }
                    return;
                }
            }
        }
    }

    pub(crate) fn team(&self, robot: RobotId) -> &Team {
        &self.robots[&robot].team
    }

    /// What the robot's clock shows now, ns.
    pub(crate) fn clock_ns(&self, robot: RobotId) -> u64 {
        self.robots[&robot].clock.at(self.now_ns).monotonic_ns
    }

    pub(crate) fn pair(&self, robot: RobotId) -> (RobotId, RobotId) {
        let (group, now_ns) = (self.team(robot).group(), self.clock_ns(robot));
        (group.leader(now_ns), group.group(now_ns))
    }

    /// A robot sees an obstacle somewhere where no other one is.
    pub(crate) fn see(&mut self, robot: RobotId, place: Position) {
        let now_ns = self.clock_ns(robot);
        self.robots.get_mut(&robot).unwrap().team.look(now_ns, &[place], |_| false);
    }

    fn is_alive(&self, robot: RobotId) -> bool {
        self.radio.place(robot).is_some()
    }

    pub(crate) fn alive(&self) -> impl Iterator<Item = RobotId> {
        self.radio.robots()
    }

    /// Robots that do not have the least and the greatest id of those that reach them.
    pub(crate) fn wrong(&self) -> Vec<RobotId> {
        let right = |robot: RobotId| {
            let sources = self.radio.sources(robot);
            (*sources.first().unwrap(), *sources.last().unwrap())
        };
        self.alive().filter(|robot| self.pair(*robot) != right(*robot)).collect()
    }

    /// Whether all robots that reach each other have the same records.
    pub(crate) fn views_are_equal(&self) -> bool {
        self.alive().all(|robot| {
            let digests = self.team(robot).view().digests();
            self.radio.sources(robot).iter().all(|other| self.team(*other).view().digests() == digests)
        })
    }

    pub(crate) fn synchros(&self) -> u32 {
        self.robots.values().map(|robot| robot.synchros).sum()
    }

    pub(crate) fn run_beats(&mut self, beats: u64) {
        self.run_until(self.now_ns + beats * BEAT_NS);
    }

    /// In quarters of a beat from now: when a condition holds first, and from when on it holds to the end.
    pub(crate) fn holds_from(&mut self, quarters: u32, condition: impl Fn(&Self) -> bool) -> Option<u32> {
        let mut since = None;
        for quarter in 0..quarters {
            since = if condition(self) { since.or(Some(quarter)) } else { None };
            self.run_until(self.now_ns + BEAT_NS / 4);
        }
        since
    }

    pub(crate) fn run_until(&mut self, end_ns: u64) {
        while let Some((at_ns, event)) = self.events.pop() {
            if at_ns > end_ns {
                self.events.push(at_ns, event);
                break;
            }
            self.now_ns = at_ns;
            match event {
                Event::Beat { robot, run } => self.beat(robot, run),
                Event::Router { robot, run } if self.robots[&robot].run == run && self.is_alive(robot) => {
                    self.poll_router(robot);
                }
                Event::Router { .. } => {}
                Event::Arrive { to, run, bytes } => self.arrive(to, run, &bytes),
            }
        }
        self.now_ns = end_ns;
    }

    fn beat(&mut self, id: RobotId, run: u32) {
        let now_ns = self.now_ns;
        let robot = self.robots.get_mut(&id).unwrap();
        let Some(Place { x_mm, y_mm }) = self.radio.place(id).filter(|_| robot.run == run) else { return };
        let clock_ns = robot.clock.at(now_ns).monotonic_ns;
        let pose = Some(Pose { position: Position { x_mm, y_mm }, ..Pose::default() });
        let beat = robot.team.beat(clock_ns, pose);
        robot.synchros += u32::from(beat.synchro.is_some());
        let next_ns = robot.clock.when(clock_ns + BEAT_NS, now_ns);
        self.events.push(next_ns, Event::Beat { robot: id, run });
        let records = [beat.objects, beat.synchro].into_iter().flatten().map(|records| records.encode());
        let hello = beat.hello.encode();
        records.for_each(|bytes| self.say(id, bytes, false));
        self.say(id, hello, true);
    }

    fn say(&mut self, from: RobotId, message: Vec<u8>, is_hello: bool) {
        let router = self.robots.get_mut(&from).unwrap().router.as_mut();
        let datagram = router.map_or(message.clone(), |router| router.end.send(&message));
        self.send(from, &datagram.into(), is_hello);
    }

    fn send(&mut self, from: RobotId, bytes: &Rc<[u8]>, is_hello: bool) {
        for (to, at_ns) in self.radio.send(self.now_ns, from, bytes.len(), &mut self.chance) {
            if !is_hello || !self.mute.contains(&(from, to)) {
                let run = self.robots[&to].run;
                self.events.push(at_ns, Event::Arrive { to, run, bytes: bytes.clone() });
            }
        }
    }

    fn arrive(&mut self, to: RobotId, run: u32, bytes: &[u8]) {
        let robot = self.robots.get_mut(&to).unwrap();
        if robot.died_at.is_some() || robot.run != run {
            return;
        }
        let clock_ns = robot.clock.at(self.now_ns).monotonic_ns;
        let Some(router) = &mut robot.router else { return robot.hear(clock_ns, bytes) };
        let messages = router.end.handle(clock_ns, bytes);
        messages.iter().for_each(|message| robot.hear(clock_ns, message));
        self.poll_router(to);
    }
}

impl Robot {
    fn hear(&mut self, clock_ns: u64, message: &[u8]) {
        match message[0] {
            b'H' => self.team.hear_hello(clock_ns, &Hello::decode(message).unwrap()),
            _ => self.team.hear_records(clock_ns, Records::decode(message).unwrap()),
        }
    }
}
