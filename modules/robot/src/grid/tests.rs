use super::*;
use crate::simulator::{Scanner, Settings as RobotSettings, Simulator};
use crate::world::World;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// Beams evenly around, all of one length.
fn ring(beams: usize, range_m: f32, range_max_m: f32) -> LaserScan {
    LaserScan {
        start_rad: 0.0,
        step_rad: (TAU / beams as f64) as f32,
        range_max_m,
        ranges_m: vec![range_m; beams],
        pose: None,
    }
}

fn at(x_m: f64, y_m: f64) -> Pose {
    Pose { x_m, y_m, heading_rad: 0.0 }
}

#[test]
fn a_hit_is_occupied_and_the_way_to_it_free() {
    let mut map = Mapper::new(Settings { resolution_m: 0.5, ..Settings::default() });
    let scan = LaserScan { range_max_m: 9.0, ranges_m: vec![1.75], ..LaserScan::default() };
    map.integrate(&scan, &at(0.25, 0.25)).unwrap();
    assert_eq!(map.to_text(), "....#\n");
    map.integrate(&scan, &Pose { heading_rad: PI / 2.0, ..at(0.25, 0.25) }).unwrap();
    assert_eq!(map.to_text(), "#\n.\n.\n.\n....#\n", "north is up");
    assert_eq!(map.counts(), Counts { free: 7, occupied: 2, known: 9, refused: 0 });
    assert!(map.to_pgm().starts_with(b"P5\n5 5\n255\n"));
    assert_eq!(map.to_pgm().len(), 11 + 25);
}

#[test]
fn beams_without_a_return_clear_to_the_limit_only() {
    for (range_m, range_max_m, cleared_m, why) in [
        (30.0, 30.0, 8.0, "nothing came back"),
        (81.83, 80.0, 8.0, "the mark of the SICK"),
        (5.0, 5.0, 5.0, "a scanner that sees less far than the limit"),
        (f32::INFINITY, 80.0, 8.0, "endless"),
        (50.0, 80.0, 8.0, "a hit too far away to believe"),
    ] {
        let mut map = Mapper::new(Settings::default());
        let scan = LaserScan { range_max_m, ranges_m: vec![range_m], ..LaserScan::default() };
        map.integrate(&scan, &at(0.01, 0.01)).unwrap();
        assert!(map.occupancy(cleared_m - 0.1, 0.01).is_some_and(|percent| percent < 50), "{why}");
        assert_eq!(map.occupancy(cleared_m + 0.1, 0.01), None, "{why}");
        assert_eq!(map.counts().occupied, 0, "{why}");
    }
}

#[test]
fn readings_that_are_none_change_nothing() {
    let mut map = Mapper::new(Settings::default());
    let ranges_m = vec![f32::NAN, 0.0, -1.0, f32::NEG_INFINITY];
    map.integrate(&LaserScan { range_max_m: 8.0, ranges_m, ..LaserScan::default() }, &at(0.0, 0.0)).unwrap();
    assert_eq!(map.counts(), Counts::default());
    assert_eq!(map.to_text(), "");
    for pose in [at(f64::NAN, 0.0), at(0.0, 1e9), Pose { heading_rad: f64::INFINITY, ..at(0.0, 0.0) }] {
        assert_eq!(map.integrate(&ring(8, 1.0, 8.0), &pose), Err(IntegrateError::Pose));
    }
    let endless = LaserScan { step_rad: f32::NAN, ..ring(8, 1.0, 8.0) };
    assert_eq!(map.integrate(&endless, &at(0.0, 0.0)), Err(IntegrateError::Pose));
}

#[test]
fn a_wall_that_many_beams_graze_stays() {
    // Along a corridor wall, far beams pass through the squares in which near ones end. The wall lies off the borders
    // of the map's squares, where a rounding would decide which one is hit.
    let world =
        World::parse("rohrpost-map 1\ncell_m 0.99\nmap\n##############\n#>           #\n##############\n").unwrap();
    let scanner = Scanner { range_noise_m: 0.0, range_max_m: 30.0, ..Scanner::default() };
    let mut robot = Simulator::new(world, RobotSettings { scanner, ..RobotSettings::default() });
    let mut map = Mapper::new(Settings::default());
    let pose = robot.true_pose();
    for _ in 0..10 {
        map.integrate(&robot.scan(), &pose).unwrap();
    }
    for beam in 60..85 {
        let angle_rad = f64::from(beam - 90) * PI / 180.0;
        let range_m = robot.world().cast(pose.x_m, pose.y_m, angle_rad, 30.0).unwrap() + 1e-3;
        let percent = map.occupancy(pose.x_m + range_m * angle_rad.cos(), pose.y_m + range_m * angle_rad.sin());
        assert!(percent.is_some_and(|percent| percent > 50), "{beam}: {percent:?}");
    }
}

#[test]
fn what_moved_away_is_forgotten() {
    let mut map = Mapper::new(Settings::default());
    for _ in 0..50 {
        map.integrate(&ring(1, 2.02, 8.0), &at(0.01, 0.01)).unwrap();
    }
    assert_eq!(map.occupancy(2.03, 0.01), Some(98));
    let scans = (1..100).find(|_| {
        map.integrate(&ring(1, 3.0, 8.0), &at(0.01, 0.01)).unwrap();
        map.occupancy(2.03, 0.01).is_some_and(|percent| percent < 10)
    });
    assert!(scans.is_some_and(|scans| scans <= 20), "{scans:?}");
}

#[test]
fn tiles_are_told_when_they_change_and_placed_by_their_corner() {
    let mut map = Mapper::new(Settings::default());
    map.integrate(&ring(1, 1.0, 8.0), &at(-1.02, -0.02)).unwrap();
    let west = TileIndex { column: -1, row: -1 };
    assert_eq!(map.take_changed(), [west]);
    assert_eq!(map.take_changed(), []);
    let grid = map.tile(west).unwrap();
    assert_eq!((grid.origin.x_m, grid.origin.y_m, grid.columns, grid.rows), (-6.4, -6.4, 128, 128));
    // Square (-1, -1) of the map, where the beam ends, is the last of its tile.
    assert_eq!(grid.cells.iter().position(|cell| (51..=100).contains(cell)), Some(128 * 128 - 1));
    map.integrate(&ring(360, 1.0, 8.0), &at(0.0, 0.0)).unwrap();
    assert_eq!(map.take_changed().len(), 4);
    assert!(map.tile(TileIndex { column: 9, row: 9 }).is_none());
}

#[test]
#[should_panic(expected = "a length of 0 m")]
fn squares_have_a_size() {
    Mapper::new(Settings { resolution_m: 0.0, ..Settings::default() });
}

#[test]
fn growth_is_bounded_and_counted() {
    let mut map = Mapper::new(Settings { tiles_max: 2, ..Settings::default() });
    map.integrate(&ring(360, 7.0, 8.0), &at(0.0, 0.0)).unwrap();
    assert_eq!(map.tiles().count(), 2);
    assert!(map.counts().refused > 0);
}

#[test]
fn the_simulated_world_is_mapped_as_it_is() {
    let world = World::parse(include_str!("../../../../config/building.map")).unwrap();
    let mut map = Mapper::new(Settings::default());
    let (width_m, height_m) = world.size_m();
    // From a spot in each square metre that has room for a robot, facing all four ways in turn.
    let spots = (0..24 * 16).map(|spot| (f64::from(spot % 24) + 0.5, f64::from(spot / 24) + 0.5));
    for (turn, (x_m, y_m)) in spots.filter(|(x_m, y_m)| !world.disc_collides(*x_m, *y_m, 0.25)).enumerate() {
        let pose = Pose { x_m, y_m, heading_rad: turn as f64 * PI / 2.0 };
        map.integrate(&seen_from(&world, pose), &pose).unwrap();
    }
    let (mut right, mut wrong) = (0, 0);
    for square in 0..(480 * 320) {
        let (x_m, y_m) = (f64::from(square % 480) * 0.05 + 0.025, f64::from(square / 480) * 0.05 + 0.025);
        assert!(x_m < width_m && y_m < height_m);
        match map.occupancy(x_m, y_m) {
            None | Some(50) => {}
            Some(percent) if (percent > 50) == world.is_blocked_at(x_m, y_m) => right += 1,
            Some(_) => wrong += 1,
        }
    }
    println!("{right} squares right, {wrong} wrong");
    assert!(right > 50_000 && wrong * 20 < right, "{right} squares right, {wrong} wrong");
}

/// What a noisy scanner at this pose sees.
fn seen_from(world: &World, pose: Pose) -> LaserScan {
    let seed = (pose.x_m * 1000.0 + pose.y_m) as u64;
    let scanner =
        Scanner { mounting: Pose::from(world.start().isometry().inverse() * pose.isometry()), ..Scanner::default() };
    Simulator::new(world.clone(), RobotSettings { seed, scanner, ..RobotSettings::default() }).scan()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn counts_are_those_of_the_tiles(
        poses in prop::collection::vec((-5.0..5.0, -5.0..5.0, -4.0..4.0), 1..8),
        ranges_m in prop::collection::vec(0.1f32..9.0, 1..90),
    ) {
        let mut map = Mapper::new(Settings::default());
        for (x_m, y_m, heading_rad) in poses {
            let scan = LaserScan { ranges_m: ranges_m.clone(), ..ring(ranges_m.len(), 0.0, 8.0) };
            map.integrate(&scan, &Pose { x_m, y_m, heading_rad }).unwrap();
        }
        let cells: Vec<u8> = map.tiles().flat_map(|index| map.tile(index).unwrap().cells).collect();
        let count = |of: fn(u8) -> bool| cells.iter().filter(|cell| of(**cell)).count() as u64;
        prop_assert_eq!(map.counts().known, count(|cell| cell != 255));
        prop_assert_eq!(map.counts().free, count(|cell| cell < 50));
        prop_assert_eq!(map.counts().occupied, count(|cell| cell > 50 && cell != 255));
    }
}
