use super::*;
use crate::testing::TestScene;

const SOUTH_WEST: Pose = Pose { x_m: -1.0, y_m: -2.0, heading_rad: 0.0 };

fn tile(origin: Pose, columns: u32, rows: u32) -> OccupancyGrid {
    OccupancyGrid { origin, resolution_m: 0.1, columns, rows, cells: vec![0; (columns * rows) as usize] }
}

#[test]
fn a_way_of_any_length_is_drawn_with_few_entities_and_rows() {
    let mut drawing = TestScene::new();
    let steps = 5_000u32;
    for step in 0..steps {
        let angle = f64::from(step) * 0.02;
        let pose = Pose { x_m: 10.0 * angle.cos(), y_m: 10.0 * angle.sin(), heading_rad: angle };
        drawing.scene.pose("slam.0", &pose);
    }
    let rows = drawing.rows();
    let trajectory: Vec<_> =
        rows.iter().filter(|(entity, _)| entity.starts_with("/world/trajectory/slam.0/")).collect();
    assert_eq!(trajectory.len(), CHUNKS_MAX);
    assert!(trajectory.iter().map(|(_, rows)| **rows).sum::<usize>() <= steps as usize);
    assert_eq!(rows["/world/robot/slam.0"], steps as usize);
    assert_eq!(rows["/world/robot/slam.0/body"], 1, "the body is drawn once and moved");
    assert!(rows["/world/frame"] < 40, "{}", rows["/world/frame"]);
}

#[test]
fn a_scan_lies_where_it_says_or_else_on_its_carrier() {
    let scan = |pose| LaserScan { step_rad: 0.1, range_max_m: 8.0, ranges_m: vec![2.0], pose, ..LaserScan::default() };
    let carrier = Pose { x_m: 5.0, heading_rad: std::f64::consts::FRAC_PI_2, ..Pose::default() };
    let mount = Pose { x_m: 1.0, ..Pose::default() };
    for (own, at, why) in [
        (None, [5.0, 3.0], "the carrier looks along y: 1 m to the scanner, 2 m to the wall"),
        (Some(SOUTH_WEST), [1.0, -2.0], "the scan knows better than its carrier"),
    ] {
        let scan = scan(own);
        let stand = scan.pose.unwrap_or_else(|| (carrier.isometry() * mount.isometry()).into());
        let points = hits(&scan, &stand.isometry(), &mut Extent::default());
        assert!((points[0][0] - at[0]).hypot(points[0][1] - at[1]) < 1e-5, "{why}: {points:?}");
    }
}

#[test]
fn a_stray_beam_is_neither_drawn_nor_makes_the_world_larger() {
    let mut ranges_m = vec![3.0; 100];
    ranges_m[40] = 70.0;
    let scan = LaserScan { step_rad: 0.01, range_max_m: 80.0, ranges_m, ..LaserScan::default() };
    let mut extent = Extent::default();
    let points = hits(&scan, &Isometry2::identity(), &mut extent);
    assert_eq!(points.len(), 99);
    assert!(!extent.contains([20.0, 10.0]));
}

#[test]
fn a_map_grows_by_tiles_and_a_tile_replaces_itself() {
    let mut drawing = TestScene::new();
    for east in [0.0, 6.4, 12.8, 0.0] {
        drawing.scene.grid("map.0", &tile(Pose { x_m: east, ..SOUTH_WEST }, 64, 64)).unwrap();
    }
    let rows = drawing.rows();
    let tiles: Vec<_> = rows.iter().filter(|(entity, _)| entity.starts_with("/world/map/map.0/")).collect();
    assert_eq!(tiles.len(), 3);
    assert_eq!(tiles.iter().map(|(_, rows)| **rows).sum::<usize>(), 2 * 4, "place and picture of four tiles");
}

#[test]
fn only_what_is_known_of_a_tile_is_drawn() {
    let mut grid = tile(SOUTH_WEST, 5, 4);
    grid.cells.fill(255);
    assert!(tile::known(&grid).is_none(), "nothing is known");
    grid.cells[5 + 2] = 100;
    grid.cells[2 * 5 + 3] = 0;
    let part = tile::known(&grid).unwrap();
    assert_eq!((part.columns, part.rows, part.cells.as_slice()), (2, 2, &[100, 255, 255, 0][..]));
    let corner = part.corners()[0];
    assert!((corner[0] + 0.8).abs() < 1e-6 && (corner[1] + 1.9).abs() < 1e-6, "{corner:?}");
}

#[test]
fn maps_that_cannot_be_true_are_refused() {
    let mut drawing = TestScene::new();
    let good = tile(SOUTH_WEST, 4, 4);
    for (grid, why) in [
        (
            OccupancyGrid { rows: 5, ..good.clone() },
            "map of m.0: 4 x 5 cells announced, 16 there; its sender is at fault",
        ),
        (
            OccupancyGrid { columns: u32::MAX, rows: u32::MAX, ..good.clone() },
            "map of m.0: 4294967295 x 4294967295 cells announced, 16 there; its sender is at fault",
        ),
        (
            OccupancyGrid { resolution_m: 0.0, ..good.clone() },
            "map of m.0: its origin or its resolution is not a usable number; its sender is at fault",
        ),
        (
            OccupancyGrid { origin: Pose { x_m: f64::NAN, ..SOUTH_WEST }, ..good.clone() },
            "map of m.0: its origin or its resolution is not a usable number; its sender is at fault",
        ),
    ] {
        assert_eq!(drawing.scene.grid("m.0", &grid).unwrap_err().to_string(), why);
    }
    drawing.scene.grid("m.0", &OccupancyGrid::default()).unwrap_err();
}
