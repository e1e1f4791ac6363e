use super::*;
use crate::pinhole::tests::{FOUR, STAND, room};
use proptest::prelude::*;
use rohrpost_modules::types::{Bytes, Point};

fn look(pinhole: Pinhole, stand: &Pose) -> Vec<Point> {
    let mut sensor = SimulatedDepth::new(pinhole);
    let mut cloud = sensor.cloud();
    cloud.points = Bytes(vec![0; cloud.raw_bytes() as usize]);
    sensor.look(&room(), stand, &mut cloud.points);
    cloud.points().unwrap().collect()
}

/// Depths are those of `pinhole_tests`: walls at 2.67 m and 5 m; ceiling at 2 m and 6 m, floor at 4 m and 1.33 m.
#[test]
fn points_lie_where_the_room_is() {
    let near = 2.0 / 0.75;
    let low = 1.0 / 0.75;
    let expected = [
        [[2.0, 1.5, 1.5], [2.0, 0.5, 1.5], [2.0, -0.5, 1.5], [2.0, -1.5, 1.5]],
        [[near, 2.0, near / 4.0], [5.0, 1.25, 1.25], [5.0, -1.25, 1.25], [near, -2.0, near / 4.0]],
        [[near, 2.0, -near / 4.0], [4.0, 1.0, -1.0], [4.0, -1.0, -1.0], [near, -2.0, -near / 4.0]],
        [[low, 1.0, -1.0], [low, low / 4.0, -1.0], [low, -low / 4.0, -1.0], [low, -1.0, -1.0]],
    ];
    let found = look(FOUR, &STAND);
    assert_eq!(found.len(), 16);
    for (index, (found, expected)) in found.iter().zip(expected.as_flattened()).enumerate() {
        for (found, expected) in [found.x_m, found.y_m, found.z_m].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "point {index}: {found} and not {expected}");
        }
    }
}

#[test]
fn nothing_comes_back_from_beyond_the_range() {
    let seen = |depth_max_m| {
        let points = look(Pinhole { depth_max_m, ..FOUR }, &STAND);
        points.iter().map(Point::is_seen).collect::<Vec<bool>>()
    };
    for (depth_max_m, rows) in [
        (6.0, ["++++", "++++", "++++", "++++"]),
        (4.5, ["++++", "+--+", "++++", "++++"]),
        (3.0, ["++++", "+--+", "+--+", "++++"]),
        (1.9, ["----", "----", "----", "++++"]),
        (1.0, ["----"; 4]),
    ] {
        let expected: Vec<bool> = rows.concat().chars().map(|mark| mark == '+').collect();
        assert_eq!(seen(depth_max_m), expected, "up to {depth_max_m} m");
    }
}

#[test]
fn a_sensor_fills_the_cloud_that_it_names() {
    let cloud = SimulatedDepth::new(DEPTH_SENSOR).cloud();
    assert_eq!((cloud.columns, cloud.rows), (640, 320));
    assert_eq!(cloud.raw_bytes(), 204_800 * 12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// From anywhere in the room: each point is on its floor, its ceiling or one of its walls, to a millimetre.
    #[test]
    fn each_point_lies_on_the_room(x_m in 1.3..6.7, y_m in 1.3..4.7, heading_rad in -7.0..7.0f64) {
        let stand = Pose { x_m, y_m, heading_rad };
        let mounting = Pose { x_m: 0.2, y_m: -0.1, heading_rad: 0.4 };
        let pinhole = Pinhole { width_px: 16, height_px: 12, mounting, height_m: 0.7, ..FOUR };
        let eye = stand.isometry() * mounting.isometry();
        for point in look(pinhole, &stand) {
            let place = eye * nalgebra::Point2::new(f64::from(point.x_m), f64::from(point.y_m));
            let height_m = f64::from(point.z_m) + 0.7;
            let on = |found: f64, border: f64| (found - border).abs() < 1e-3;
            let inside = |found: f64, least: f64, most: f64| (least - 1e-3..=most + 1e-3).contains(&found);
            let level = on(height_m, 0.0) || on(height_m, 2.5);
            let wall = on(place.x, 1.0) || on(place.x, 7.0) || on(place.y, 1.0) || on(place.y, 5.0);
            prop_assert!(level || wall, "{point:?} is at {place}, {height_m} m above the floor");
            prop_assert!(inside(place.x, 1.0, 7.0) && inside(place.y, 1.0, 5.0) && inside(height_m, 0.0, 2.5));
        }
    }
}
