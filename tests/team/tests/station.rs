//! A station among mobiles: fake intruders, requests, and clocks that differ (seed 000, 5.1.4).

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_arena::{Arena, ArenaSettings, Conduct};
use rohrpost_payload::{Asking, Ground, Mode, Payload, RequestKind, Sensed, Settings, Station, StationRefusal};
use rohrpost_team::grid::{Cell, Direction, Map};
use rohrpost_team::view::{ObjectId, Records};
use rohrpost_team::{Position, RobotId, Team, Version};
use rohrpost_virtual_team::standard::{BEAT_NS, S_NS, team_settings};
use std::collections::BTreeMap;
use std::sync::Arc;

const MAP: &str = "rohrpost-map 1\ncell_m 1\nmap\n##########\n#        #\n##########\n";
/// Time on the air.
const DELAY_NS: u64 = 20_000_000;
const STEP_NS: u64 = 10_000_000;
const SCAN_NS: u64 = 100_000_000;
/// Behind all mobiles.
const FAKE: Position = Position { x_mm: 8500, y_mm: 1500 };

enum Kernel {
    Mobile(Payload),
    Station(Station),
}

struct End {
    id: RobotId,
    /// What its clock shows at true time 0, ns.
    ahead_ns: u64,
    starts_ns: u64,
    kernel: Option<Kernel>,
    obeys: bool,
}

impl End {
    fn team(&self) -> &Team {
        match self.kernel.as_ref().unwrap() {
            Kernel::Mobile(payload) => payload.team(),
            Kernel::Station(station) => station.team(),
        }
    }
}

/// Robots that stand, a station, and an intruder that the first robot sees.
struct Scene {
    now_ns: u64,
    ground: Arc<Ground>,
    arena: Arena,
    ends: Vec<End>,
    on_air: Vec<(u64, RobotId, Vec<u8>)>,
    /// Whether events of this robot are lost.
    deaf_to: Option<RobotId>,
    /// How often each version of each object was sent.
    sent: BTreeMap<(ObjectId, Version), usize>,
}

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

const STATION: u8 = 6;

impl Scene {
    fn new(sees_intruder: bool) -> Self {
        let map = Map::read(MAP.as_bytes()).unwrap();
        let settings = Settings::default();
        let ground = Arc::new(Ground::read(MAP.as_bytes(), None, settings.margin_m).unwrap());
        let scanner =
            rohrpost_robot::simulator::Scanner { field_of_view_rad: std::f64::consts::TAU, ..Default::default() };
        let robot = rohrpost_robot::simulator::Settings { scanner, ..Default::default() };
        let settings = ArenaSettings { cell_m: 1.0, robot, intruder_radius_m: 0.25 };
        let mut arena = Arena::new(&map, settings).unwrap();
        if sees_intruder {
            arena.add_intruder(Cell { column: 4, row: 1 }, Conduct::Stands);
        }
        let (on_air, ends, sent) = (Vec::new(), Vec::new(), BTreeMap::new());
        Self { now_ns: 0, ground, arena, ends, on_air, deaf_to: None, sent }
    }

    fn add(&mut self, system: u8, ahead_ns: u64, starts_ns: u64, obeys: bool) {
        if system != STATION {
            self.arena.add_robot(id(system), Cell { column: system.into(), row: 1 }, Direction::East).unwrap();
        }
        self.ends.push(End { id: id(system), ahead_ns, starts_ns, kernel: None, obeys });
    }

    fn end(&mut self, system: u8) -> &mut End {
        self.ends.iter_mut().find(|end| end.id.get() == system).unwrap()
    }

    fn clock_ns(&mut self, system: u8) -> u64 {
        self.now_ns + self.end(system).ahead_ns
    }

    /// Lets the station do something now.
    fn station<R>(&mut self, act: impl FnOnce(&mut Station, u64) -> R) -> R {
        let now_ns = self.clock_ns(STATION);
        match self.end(STATION).kernel.as_mut() {
            Some(Kernel::Station(station)) => act(station, now_ns),
            _ => panic!("the station does not run"),
        }
    }

    fn states(&mut self) -> Vec<(u8, Asking)> {
        self.station(|station, _| {
            let asked = station.asked().last().unwrap();
            asked.robots.iter().map(|(robot, (_, asking))| (robot.get(), *asking)).collect()
        })
    }

    fn run_s(&mut self, seconds: u64) {
        let until_ns = self.now_ns + seconds * S_NS;
        while self.now_ns < until_ns {
            self.step();
            self.now_ns += STEP_NS;
        }
    }

    fn step(&mut self) {
        self.arena.step_to(self.now_ns);
        let (due, later) = std::mem::take(&mut self.on_air).into_iter().partition(|(at_ns, ..)| *at_ns <= self.now_ns);
        self.on_air = later;
        let due: Vec<(u64, RobotId, Vec<u8>)> = due;
        for end in &mut self.ends {
            let clock_ns = self.now_ns + end.ahead_ns;
            let runs_ns = self.now_ns.checked_sub(end.starts_ns);
            let Some(runs_ns) = runs_ns else { continue };
            if runs_ns == 0 {
                end.kernel = Some(begin(end, clock_ns, &self.ground, 1));
            }
            let Some(kernel) = &mut end.kernel else { continue };
            let is_lost = |from: RobotId, bytes: &[u8]| bytes[0] == b'E' && self.deaf_to == Some(from);
            for (_, from, bytes) in due.iter().filter(|(_, from, bytes)| *from != end.id && !is_lost(*from, bytes)) {
                let heard = match kernel {
                    Kernel::Mobile(payload) => payload.hear(clock_ns, bytes),
                    Kernel::Station(station) => station.hear(clock_ns, bytes),
                };
                heard.unwrap_or_else(|error| panic!("{from} to {}: {error}", end.id));
            }
            if let Kernel::Mobile(payload) = kernel
                && runs_ns.is_multiple_of(SCAN_NS)
            {
                let (scan, pose) = (self.arena.scan(end.id).unwrap(), self.arena.moment(end.id).unwrap().pose);
                payload.sense(clock_ns, Sensed { pose: Some(pose), speed_m_s: 0.0, scan });
            }
            // Beats of no two ends coincide.
            if (runs_ns + 30_000_000 * u64::from(end.id.get())).is_multiple_of(BEAT_NS) {
                match kernel {
                    Kernel::Mobile(payload) => payload.beat(clock_ns),
                    Kernel::Station(station) => station.beat(clock_ns),
                }
            }
            let messages = match kernel {
                Kernel::Mobile(payload) => payload.take_messages(),
                Kernel::Station(station) => station.take_messages(),
            };
            for message in messages {
                count(&message, &mut self.sent);
                self.on_air.push((self.now_ns + DELAY_NS, end.id, message));
            }
            if matches!(kernel, Kernel::Mobile(payload) if payload.has_quit()) {
                end.kernel = None;
            }
        }
    }
}

fn begin(end: &End, clock_ns: u64, ground: &Arc<Ground>, incarnation: u32) -> Kernel {
    let stations = end.obeys.then(|| id(STATION)).into_iter().collect();
    let settings = Settings { stations, coordination: None, ..Settings::default() };
    let team = team_settings(&settings);
    if end.id.get() == STATION {
        return Kernel::Station(Station::new(clock_ns, end.id, incarnation, ground.clone(), team).unwrap());
    }
    Kernel::Mobile(Payload::new(clock_ns, end.id, incarnation, ground.clone(), settings, team, 1).unwrap())
}

fn count(message: &[u8], sent: &mut BTreeMap<(ObjectId, Version), usize>) {
    let Ok(records) = Records::decode(message) else { return };
    for (observer, ledger) in &records.ledgers {
        for (number, kept) in &ledger.records {
            let object = ObjectId { observer: *observer, number: *number };
            *sent.entry((object, kept.record.version)).or_default() += 1;
        }
    }
}

#[test]
fn clocks_half_a_second_apart_cost_one_message_an_object_at_most_and_ages_are_true() {
    let late_ns = 5 * S_NS;
    for (ahead_ns, starts_ns) in [([0, 500_000_000], [0, late_ns]), ([500_000_000, 0], [0, late_ns])]
        .into_iter()
        .flat_map(|(ahead, starts)| [(ahead, starts), (ahead, [starts[1], starts[0]])])
    {
        let mut scene = Scene::new(true);
        scene.add(2, ahead_ns[0] + S_NS, starts_ns[0], true);
        scene.add(STATION, ahead_ns[1] + S_NS, starts_ns[1], false);
        scene.run_s(12);
        scene.station(|station, now_ns| station.set_fake(now_ns, FAKE)).unwrap();
        scene.run_s(15);
        let what = format!("clocks ahead by {ahead_ns:?}, started at {starts_ns:?}");
        assert!(scene.sent.len() >= 2, "{what}: {:?}", scene.sent);
        assert!(scene.sent.values().all(|count| *count <= 2), "{what}: {:?}", scene.sent);
        let ages: Vec<BTreeMap<ObjectId, i64>> = [2, STATION]
            .map(|system| {
                let now_ns = scene.clock_ns(system);
                let objects = scene.end(system).team().view().objects();
                objects.into_iter().map(|object| (object.id, now_ns as i64 - object.seen_ns as i64)).collect()
            })
            .into();
        assert_eq!(ages[0].len(), 2, "{what}: {ages:?}");
        assert!(ages[0].keys().eq(ages[1].keys()), "{what}: {ages:?}");
        for (object, age_ns) in &ages[0] {
            let error_ns = ages[1][object].abs_diff(*age_ns);
            assert!(error_ns <= DELAY_NS + 1_000_000, "{what}: {object:?}: {ages:?}");
        }
    }
}

#[test]
fn a_fake_intruder_is_set_moved_and_removed_by_its_station_and_is_marked_everywhere() {
    let mut scene = Scene::new(false);
    scene.add(1, 0, 0, true);
    scene.add(STATION, S_NS, 0, false);
    scene.run_s(6);
    let wall = Position { x_mm: 500, y_mm: 500 };
    let refused = scene.station(|station, now_ns| station.set_fake(now_ns, wall)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "an intruder cannot be at 500 mm, 500 mm: that is on no path of the map; name a place on one"
    );
    let fake = scene.station(|station, now_ns| station.set_fake(now_ns, FAKE)).unwrap();
    scene.run_s(2);
    let seen = |scene: &mut Scene| -> Vec<(Position, bool, bool)> {
        let objects = scene.end(1).team().view().objects();
        objects.iter().map(|object| (object.position, object.is_fake, object.certain)).collect()
    };
    assert_eq!(seen(&mut scene), [(FAKE, true, true)]);
    let mode = |scene: &mut Scene| match scene.end(1).kernel.as_ref() {
        Some(Kernel::Mobile(payload)) => payload.mode(),
        _ => panic!("robot 1 does not run"),
    };
    assert_eq!(mode(&mut scene), Mode::Blocking, "robots take it for an intruder");
    let there = Position { x_mm: 6500, ..FAKE };
    scene.station(|station, now_ns| station.move_fake(now_ns, fake, there)).unwrap();
    scene.run_s(2);
    assert_eq!(seen(&mut scene), [(there, true, true)]);
    scene.run_s(130);
    assert_eq!(seen(&mut scene), [(there, true, true)], "only its station ends it");
    scene.station(|station, now_ns| station.remove_fake(now_ns, fake)).unwrap();
    scene.run_s(2);
    assert_eq!((seen(&mut scene), mode(&mut scene)), (vec![], Mode::Wandering));
    let gone = scene.station(|station, now_ns| station.move_fake(now_ns, fake, FAKE));
    assert_eq!(gone, Err(StationRefusal::NoFake));
    let far = |at: i32| Position { x_mm: 1000 * (1 + at % 8) + 500, y_mm: 1500 };
    for at in 0..24 {
        scene.station(|station, now_ns| station.set_fake(now_ns, far(at))).unwrap();
    }
    let more = scene.station(|station, now_ns| station.set_fake(now_ns, FAKE));
    assert_eq!(more, Err(StationRefusal::TooMany));
}

#[test]
fn requests_are_repeated_until_each_robot_has_answered_by_name_or_is_given_up() {
    let mut scene = Scene::new(false);
    for (system, obeys) in [(1, true), (2, false), (3, true)] {
        scene.add(system, u64::from(system) * S_NS, 0, obeys);
    }
    scene.add(STATION, 0, 0, false);
    let nobody = |scene: &mut Scene, robot| scene.station(|station, now| station.ask(now, RequestKind::Info, robot));
    scene.step();
    assert_eq!(nobody(&mut scene, None), Err(StationRefusal::Nobody));
    scene.run_s(3);
    assert_eq!(nobody(&mut scene, Some(id(9))), Err(StationRefusal::NotHeard(id(9))));
    scene.station(|station, now_ns| station.ask(now_ns, RequestKind::Info, None)).unwrap();
    scene.run_s(1);
    assert_eq!(scene.states(), [(1, Asking::Done), (2, Asking::Refused), (3, Asking::Done)]);
    let said = scene.station(|station, _| station.said().map(|said| said.text.clone()).collect::<Vec<_>>());
    assert!(said.contains(&"obeys no station".into()) && said.iter().any(|said| said.starts_with("wandering at ")));
    // What robot 3 says is lost: it does what is asked, once, and nobody knows.
    scene.deaf_to = Some(id(3));
    scene.station(|station, now_ns| station.ask(now_ns, RequestKind::Quit, None)).unwrap();
    scene.run_s(2);
    assert_eq!(scene.states(), [(1, Asking::Done), (2, Asking::Refused), (3, Asking::Waiting)]);
    scene.run_s(12);
    assert_eq!(scene.states()[2], (3, Asking::GivenUp));
    let runs: Vec<u8> = scene.ends.iter().filter(|end| end.kernel.is_some()).map(|end| end.id.get()).collect();
    assert_eq!(runs, [2, STATION], "robots that obey have ended");
}

#[test]
fn an_answer_that_was_lost_is_given_again_and_a_restarted_robot_is_not_asked() {
    let mut scene = Scene::new(false);
    scene.add(1, 0, 0, true);
    scene.add(3, 0, 0, true);
    scene.add(STATION, 0, 0, false);
    scene.run_s(3);
    scene.deaf_to = Some(id(1));
    scene.station(|station, now_ns| station.ask(now_ns, RequestKind::Quit, Some(id(1)))).unwrap();
    scene.run_s(1);
    assert_eq!(scene.states(), [(1, Asking::Waiting)]);
    scene.deaf_to = None;
    scene.run_s(1);
    assert_eq!(scene.states(), [(1, Asking::Done)]);
    // The station is not heard while robot 3 starts again.
    scene.deaf_to = Some(id(STATION));
    scene.station(|station, now_ns| station.ask(now_ns, RequestKind::Quit, Some(id(3)))).unwrap();
    let clock_ns = scene.clock_ns(3);
    let ground = scene.ground.clone();
    let end = scene.end(3);
    end.kernel = Some(begin(end, clock_ns, &ground, 2));
    scene.run_s(1);
    scene.deaf_to = None;
    scene.run_s(8);
    assert_eq!(scene.states(), [(3, Asking::Restarted)]);
    assert!(scene.end(3).kernel.is_some(), "the new run was not meant");
}
