use super::*;
use crate::grid::{Mapper, Settings as MapSettings};
use crate::simulator::{Settings as RobotSettings, Simulator};
use crate::world::World;
use std::collections::{BTreeSet, VecDeque};

const TENTH_NS: u64 = 100_000_000;

fn building() -> World {
    World::parse(include_str!("../../../config/building.map")).unwrap()
}

/// The rooms of the building: name, west, south, east, north, in metres.
const ROOMS: [(&str, f64, f64, f64, f64); 8] = [
    ("corridor", 0.2, 7.0, 23.8, 9.0),
    ("south-west", 0.2, 0.2, 8.0, 6.8),
    ("conference", 8.2, 0.2, 16.4, 6.8),
    ("workshop", 16.6, 0.2, 23.8, 6.8),
    ("laboratory", 0.2, 9.2, 6.0, 15.8),
    ("office", 6.2, 9.2, 12.4, 15.8),
    ("small office", 12.6, 9.2, 18.0, 15.8),
    ("lobby", 18.2, 9.2, 23.8, 15.8),
];

/// What a drive came to.
struct Drive {
    bumps: u64,
    rooms: BTreeSet<&'static str>,
    /// Squares known after each minute.
    known: Vec<u64>,
    way_m: f64,
    end: Simulator,
}

/// Scan, command, ten times a second; the command comes so many scans late.
fn drive(seed: u64, world: World, minutes: u64, late: usize) -> Drive {
    let mut robot = Simulator::new(world, RobotSettings { seed, ..RobotSettings::default() });
    let mut pilot = Pilot::new(Settings { seed, ..Settings::default() });
    let mut on_the_way = VecDeque::from(vec![Twist::default(); late]);
    let mut map = Mapper::new(MapSettings { resolution_m: 0.1, ..MapSettings::default() });
    let (mut rooms, mut known, mut way_m) = (BTreeSet::new(), Vec::new(), 0.0);
    for tenth in 1..=minutes * 600 {
        let scan = robot.scan();
        let before = robot.true_pose();
        if tenth % 10 == 0 {
            map.integrate(&scan, &before).unwrap();
        }
        on_the_way.push_back(pilot.drive(&scan));
        robot.command(on_the_way.pop_front().unwrap(), (tenth - 1) * TENTH_NS).unwrap();
        robot.step_to(tenth * TENTH_NS);
        let pose = robot.true_pose();
        way_m += (pose.x_m - before.x_m).hypot(pose.y_m - before.y_m);
        let inside = |room: &&(&str, f64, f64, f64, f64)| {
            (room.1..room.3).contains(&pose.x_m) && (room.2..room.4).contains(&pose.y_m)
        };
        rooms.extend(ROOMS.iter().filter(inside).map(|room| room.0));
        if tenth % 600 == 0 {
            known.push(map.counts().known);
        }
    }
    Drive { bumps: robot.bumps(), rooms, known, way_m, end: robot }
}

#[test]
fn it_visits_the_building_without_touching_it() {
    let mut rooms = Vec::new();
    for seed in 1..=20 {
        let drive = drive(seed, building(), 3, 0);
        println!("{seed}: {:.0} m, {:?}, {:?}, {:?}", drive.way_m, drive.known, drive.rooms, drive.end.true_pose());
        assert_eq!(drive.bumps, 0, "seed {seed}");
        assert!(drive.way_m > 20.0, "seed {seed} goes on: {} m", drive.way_m);
        assert!(drive.known[2] > drive.known[0], "seed {seed} sees more and more: {:?}", drive.known);
        rooms.push(drive.rooms.len());
    }
    rooms.sort_unstable();
    assert!(rooms[10] >= 4, "half of the drives visit four rooms: {rooms:?}");
}

#[test]
fn late_commands_do_no_harm() {
    for seed in 1..=4 {
        let drive = drive(seed, building(), 3, 1);
        assert!(drive.bumps == 0 && drive.way_m > 20.0, "seed {seed}: {} bumps in {} m", drive.bumps, drive.way_m);
    }
}

#[test]
fn it_gets_out_of_dead_ends() {
    // A blind alley 1 m wide, and a niche at its end.
    let alley = concat!(
        "rohrpost-map 1\ncell_m 0.2\nmap\n",
        "##############################\n",
        "######             #         #\n",
        "######             #         #\n",
        "#      <                     #\n",
        "#                            #\n",
        "######                       #\n",
        "######             #         #\n",
        "##############################\n"
    );
    for seed in 1..=10 {
        let drive = drive(seed, World::parse(alley).unwrap(), 1, 0);
        assert_eq!(drive.bumps, 0, "seed {seed}");
        assert!(drive.way_m > 6.0, "seed {seed} stays behind: {} m", drive.way_m);
    }
}

#[test]
fn the_same_seed_drives_the_same_way() {
    assert_eq!(drive(5, building(), 1, 0).end.true_pose(), drive(5, building(), 1, 0).end.true_pose());
    assert_ne!(drive(5, building(), 1, 0).end.true_pose(), drive(6, building(), 1, 0).end.true_pose());
}

/// A half circle of 181 beams, all as long as `range_m` says of their angle in radians.
fn scan(range_m: impl Fn(f64) -> f64) -> LaserScan {
    let (start_rad, step_rad) = (-std::f64::consts::FRAC_PI_2, std::f64::consts::PI / 180.0);
    let ranges_m = (0..181).map(|beam| range_m(start_rad + f64::from(beam) * step_rad) as f32).collect();
    LaserScan { start_rad: start_rad as f32, step_rad: step_rad as f32, range_max_m: 8.0, ranges_m, pose: None }
}

#[test]
fn it_can_always_stop_in_the_way_it_sees() {
    let Settings { braking_m_s2, reaction_s, radius_m, margin_m, .. } = Settings::default();
    for way_cm in 0..300 {
        let wall_m = radius_m + margin_m + f64::from(way_cm) / 100.0;
        let twist =
            Pilot::new(Settings::default()).drive(&scan(|angle_rad| (wall_m / angle_rad.cos()).clamp(0.0, 8.0)));
        let stop_m = twist.speed_m_s * reaction_s + twist.speed_m_s.powi(2) / (2.0 * braking_m_s2);
        assert!(stop_m <= f64::from(way_cm) / 100.0 + 1e-3, "{way_cm} cm: {twist:?}");
    }
}

#[test]
fn it_keeps_turning_one_way_until_clear() {
    let mut pilot = Pilot::new(Settings::default());
    let first = pilot.drive(&scan(|angle_rad| if angle_rad > 0.5 { 3.0 } else { 0.4 }));
    assert!(first.speed_m_s == 0.0 && first.turn_rate_rad_s > 0.0, "left is more open: {first:?}");
    let then = pilot.drive(&scan(|angle_rad| if angle_rad < -0.5 { 3.0 } else { 0.4 }));
    assert_eq!(then, first, "the right being more open now does not turn it back");
    assert!(pilot.drive(&scan(|_| 8.0)).speed_m_s > 0.1, "clear: it drives again");
}

#[test]
fn blind_it_stands() {
    let mut pilot = Pilot::new(Settings::default());
    let half_blind = scan(|angle_rad| if angle_rad > -0.1 { f64::NAN } else { 8.0 });
    for blind in [LaserScan::default(), scan(|_| f64::NAN), scan(|_| 0.0), half_blind] {
        assert_eq!(pilot.drive(&blind), Twist::default());
    }
}

#[test]
fn it_minds_where_the_scanner_is() {
    // Mounted at the back, a wall at 0.6 m is nearer than it seems from the front, and the other way round.
    let speed = |x_m| {
        let mounting = Pose { x_m, ..Pose::default() };
        let mut pilot = Pilot::new(Settings { mounting, ..Settings::default() });
        pilot.drive(&scan(|angle_rad| (0.6 / angle_rad.cos()).clamp(0.0, 8.0))).speed_m_s
    };
    assert!(speed(-0.1) < speed(0.0) && speed(0.0) < speed(0.1));
}
