use super::*;
use crate::robot::grid::{Mapper, Settings as MapSettings};
use crate::robot::simulator::{Settings as RobotSettings, Simulator};
use crate::robot::world::World;
use std::collections::BTreeSet;

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

/// What three minutes of driving came to.
struct Drive {
    bumps: u64,
    rooms: BTreeSet<&'static str>,
    /// Squares known after each minute.
    known: Vec<u64>,
    way_m: f64,
    end: Simulator,
}

fn drive(seed: u64, world: World, minutes: u64) -> Drive {
    let mut robot = Simulator::new(world, RobotSettings { seed, ..RobotSettings::default() });
    let mut pilot = Pilot::new(Settings { seed, ..Settings::default() });
    let mut map = Mapper::new(MapSettings { resolution_m: 0.1, ..MapSettings::default() });
    let (mut rooms, mut known, mut way_m) = (BTreeSet::new(), Vec::new(), 0.0);
    for tenth in 1..=minutes * 600 {
        let scan = robot.scan();
        let before = robot.true_pose();
        map.integrate(&scan, &before).unwrap();
        robot.command(pilot.drive(&scan), (tenth - 1) * TENTH_NS).unwrap();
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
        let drive = drive(seed, building(), 3);
        println!("{seed}: {:.0} m, {:?}, {:?}, {:?}", drive.way_m, drive.known, drive.rooms, drive.end.true_pose());
        assert_eq!(drive.bumps, 0, "seed {seed}");
        assert!(drive.way_m > 20.0, "seed {seed} goes on: {} m", drive.way_m);
        assert!(drive.known[2] > drive.known[0], "seed {seed} sees more and more: {:?}", drive.known);
        rooms.push(drive.rooms.len());
    }
    rooms.sort_unstable();
    assert!(rooms[10] >= 4, "half of the drives visit four rooms: {rooms:?}");
}
