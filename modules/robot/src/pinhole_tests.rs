use super::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// A room of 6 m by 4 m, with walls around it that are 1 m thick.
pub(crate) const ROOM: &str =
    "rohrpost-map 1\ncell_m 1\nmap\n########\n#      #\n#>     #\n#      #\n#      #\n########\n";

/// 4 by 4 pixels over 90°, 1 m above the floor: slopes are 0.75, 0.25, -0.25 and -0.75 both ways.
pub(crate) const FOUR: Pinhole = Pinhole {
    width_px: 4,
    height_px: 4,
    field_of_view_rad: FRAC_PI_2,
    depth_max_m: 40.0,
    mounting: Pose { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 },
    height_m: 1.0,
};

/// 5 m before the east wall, 2 m from the walls in the north and in the south.
pub(crate) const STAND: Pose = Pose { x_m: 2.0, y_m: 3.0, heading_rad: 0.0 };

pub(crate) fn room() -> World {
    World::parse(ROOM).unwrap()
}

fn seen(pinhole: Pinhole, stand: Pose) -> Vec<(f32, WallSide)> {
    let mut walls = Walls::new(pinhole);
    walls.look(&room(), &stand);
    walls.columns().iter().map(|column| (column.depth_m, column.side)).collect()
}

fn check(found: &[(f32, WallSide)], expected: &[(f32, WallSide)], why: &str) {
    assert_eq!(found.len(), expected.len(), "{why}");
    for (column, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert_eq!(found.1, expected.1, "{why}, column {column}");
        let close = found.0 == expected.0 || (found.0 - expected.0).abs() < 1e-5;
        assert!(close, "{why}, column {column}: {} and not {}", found.0, expected.0);
    }
}

#[test]
fn slopes_are_those_of_a_pinhole() {
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} and not {expected}");
    close(FOUR.focal_px(), 2.0);
    for (pixel, slope) in [0.75, 0.25, -0.25, -0.75].into_iter().enumerate() {
        close(FOUR.left(pixel as u32), slope);
        close(FOUR.up(pixel as u32), slope);
    }
    for (row, depth_m) in [1.5 / 0.75, 1.5 / 0.25, 1.0 / 0.25, 1.0 / 0.75].into_iter().enumerate() {
        close(FOUR.level_depth_m(row as u32), depth_m);
    }
    let odd = Pinhole { height_px: 3, ..FOUR };
    assert_eq!(odd.level_depth_m(1), f64::INFINITY, "a level row");
    // 640 pixels over 60°: 320 / tan(30°).
    close(Pinhole { width_px: 640, field_of_view_rad: PI / 3.0, ..FOUR }.focal_px(), 320.0 * 3f64.sqrt());
}

#[test]
fn columns_see_the_walls_where_they_stand() {
    use WallSide::{East, Inside, North, South, West};
    let side_m = 2.0 / 0.75;
    let turned = |heading_rad| Pose { heading_rad, ..STAND };
    let ahead = Pinhole { mounting: Pose { x_m: 0.5, y_m: 1.0, heading_rad: 0.0 }, ..FOUR };
    for (pinhole, stand, expected, why) in [
        (FOUR, STAND, [(side_m, South), (5.0, West), (5.0, West), (side_m, North)], "to the east"),
        (FOUR, turned(PI), [(1.0, East); 4], "to the west, 1 m away"),
        // 2 m to the wall; 0.75 of it to the left is 1.5 m, and the west wall is 1 m away.
        (
            FOUR,
            turned(FRAC_PI_2),
            [(1.0 / 0.75, East), (2.0, South), (2.0, South), (2.0, South)],
            "to the north: left of it is the west wall",
        ),
        (
            ahead,
            STAND,
            [(1.0 / 0.75, South), (1.0 / 0.25, South), (4.5, West), (4.0, North)],
            "mounted 1 m to the left",
        ),
        (
            Pinhole { depth_max_m: 4.0, ..FOUR },
            STAND,
            [(side_m, South), (f32::INFINITY, West), (f32::INFINITY, West), (side_m, North)],
            "beyond the range",
        ),
        (FOUR, Pose { x_m: 0.5, ..STAND }, [(0.0, Inside); 4], "in a wall"),
    ] {
        check(&seen(pinhole, stand), &expected, why);
    }
}
