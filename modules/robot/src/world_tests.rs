use super::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

const ROOM: &str = "rohrpost-map 1\n# a room\ncell_m 0.5\nmap\n######\n#    #\n# ^# #\n#    #\n######\n";

#[test]
fn map_is_read_as_drawn() {
    let world = World::parse(ROOM).unwrap();
    assert_eq!(world.size_m(), (3.0, 2.5));
    assert_eq!(world.start(), Pose { x_m: 1.25, y_m: 1.25, heading_rad: FRAC_PI_2 });
    assert!(world.is_blocked_at(1.75, 1.25), "the pillar");
    assert!(!world.is_blocked_at(2.25, 1.25), "right of it");
    assert!(world.is_blocked_at(-0.1, 1.0) && world.is_blocked_at(9.0, 1.0), "beyond the map");
    assert!(world.is_blocked_at(f64::NAN, 1.0));
}

#[test]
fn a_map_is_a_world_only_with_one_robot() {
    let own = |rows: &str| World::parse(&format!("rohrpost-map 1\ncell_m 1\nmap\n{rows}\n"));
    assert_eq!(own("# #"), Err(WorldError::NoStart));
    assert_eq!(own("#>#\n#<#"), Err(WorldError::SecondStart { line: 5, column: 2 }));
    assert_eq!(World::parse(OCTILE), Err(WorldError::NotThisFormat("rohrpost-map 1")));
    let told = own("#x#").unwrap_err().to_string();
    assert!(told.starts_with("line 4, column 2: `x` is no square; "), "{told}");
}

const OCTILE: &str = "type octile\nheight 3\nwidth 5\nmap\nTT@TT\nT..OT\nTTTTT\n";

#[test]
fn octile_start_is_free() {
    let world = World::parse_octile(OCTILE, 2.0).unwrap();
    assert_eq!(world.start(), Pose { x_m: 5.0, y_m: 3.0, heading_rad: 0.0 }, "the middle itself is free");
}

#[test]
fn an_octile_map_is_a_world_only_with_a_free_square_of_some_size() {
    assert_eq!(World::parse_octile("type octile\nheight 1\nwidth 2\nmap\nTT\n", 1.0), Err(WorldError::NoStart));
    assert_eq!(World::parse_octile(ROOM, 1.0), Err(WorldError::NotThisFormat("type octile")));
    for cell_m in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(World::parse_octile(OCTILE, cell_m), Err(WorldError::CellSize(cell_m)));
    }
    let told = World::parse_octile("type octile\nheight 2\nwidth 2\nmap\nT.\n", 1.0).unwrap_err().to_string();
    assert!(told.starts_with("line 5, column 3: the map ends here; "), "{told}");
}

#[test]
fn rays_are_exact() {
    let world = World::parse(ROOM).unwrap();
    for (x_m, y_m, direction_rad, range_m, why) in [
        (1.25, 1.25, 0.0, Some(0.25), "the pillar is ahead"),
        (1.25, 1.25, PI, Some(0.75), "the wall is behind"),
        (1.25, 1.25, FRAC_PI_2, Some(0.75), "up"),
        (1.0, 1.0, 0.25 * PI, Some(0.5 * 2f64.sqrt()), "through a corner, into the pillar"),
        (0.1, 0.1, 1.0, Some(0.0), "inside a wall"),
        (99.0, 0.1, 1.0, Some(0.0), "off the map"),
        (1.25, 0.75, 0.0, Some(1.25), "below the pillar"),
    ] {
        let found = world.cast(x_m, y_m, direction_rad, 100.0);
        assert!(
            matches!((found, range_m), (Some(found), Some(expected)) if (found - expected).abs() < 1e-9),
            "{why}: {found:?}, not {range_m:?}"
        );
    }
    assert_eq!(world.cast(1.25, 0.75, 0.0, 1.2), None, "out of range");
    assert!(world.cast(1.25, 0.75, 0.3, f64::INFINITY).is_some(), "an endless range ends at the border");
}

#[test]
fn disc_collides_with_sides_and_corners() {
    let world = World::parse(ROOM).unwrap();
    for (x_m, y_m, radius_m, collides, why) in [
        (1.25, 1.25, 0.24, false, "beside the pillar"),
        (1.25, 1.25, 0.26, true, "into its side"),
        (1.4, 0.9, 0.14, false, "off its corner by 0.141 m"),
        (1.4, 0.9, 0.15, true, "into its corner"),
        (0.6, 0.6, 0.2, true, "the outer wall"),
        (-5.0, 0.6, 0.2, true, "off the map"),
        (0.2, 0.2, 0.01, true, "inside a wall"),
    ] {
        assert_eq!(world.disc_collides(x_m, y_m, radius_m), collides, "{why}");
    }
}

#[test]
fn a_disc_is_blocked_if_all_of_it_is_and_nothing_is_known_off_the_map() {
    let world = World::parse("rohrpost-map 1\ncell_m 0.5\nmap\n####\n####\n##> \n").unwrap();
    for (x_m, y_m, radius_m, is_blocked, why) in [
        (1.0, 1.0, 0.4, true, "in four squares"),
        (0.6, 0.5, 0.39, true, "beside the free one"),
        (0.6, 0.5, 0.41, false, "into its side"),
        (0.8, 0.7, 0.28, true, "off its corner by 0.283 m"),
        (0.8, 0.7, 0.29, false, "into its corner"),
        (1.0, 1.0, 0.6, false, "from above"),
        (0.3, 1.0, 0.31, false, "off the map"),
        (1.9, 1.4, 0.11, false, "off the map, in the east and the north"),
        (f64::NAN, 1.0, 0.1, false, "nowhere"),
        (1.0, f64::INFINITY, 0.1, false, "nowhere"),
        (1.0, 1.0, f64::NAN, false, "no disc"),
    ] {
        assert_eq!(world.disc_is_blocked(x_m, y_m, radius_m), is_blocked, "{why}");
    }
}

proptest! {
    #[test]
    fn a_ray_ends_at_the_first_wall(x_m in 0.5..2.5, y_m in 0.5..2.0, direction_rad in -4.0..4.0) {
        let world = World::parse(ROOM).unwrap();
        prop_assume!(!world.is_blocked_at(x_m, y_m));
        let range_m = world.cast(x_m, y_m, direction_rad, 10.0).unwrap();
        let at = |distance: f64| (x_m + distance * f64::cos(direction_rad), y_m + distance * f64::sin(direction_rad));
        let (behind_x, behind_y) = at(range_m + 1e-6);
        // Grazing a corner within a millionth may leave the wall again.
        let (deeper_x, deeper_y) = at(range_m + 1e-9);
        prop_assert!(world.is_blocked_at(behind_x, behind_y) || world.is_blocked_at(deeper_x, deeper_y));
        for part in 0..100 {
            let (before_x, before_y) = at((range_m - 1e-9).max(0.0) * f64::from(part) / 100.0);
            prop_assert!(!world.is_blocked_at(before_x, before_y));
        }
    }

    #[test]
    fn no_text_panics(text in "(rohrpost-map 1\n)?(cell_m [0-9]\n)?(map\n)?[# >v\n]{0,40}") {
        let _ = World::parse(&text);
        let _ = World::parse_octile(&text, 1.0);
    }
}
