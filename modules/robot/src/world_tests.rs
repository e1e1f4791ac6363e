use super::*;
use proptest::prelude::*;

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
fn carriage_returns_do_no_harm() {
    assert_eq!(World::parse(&ROOM.replace('\n', "\r\n")), World::parse(ROOM));
}

#[test]
fn bad_maps_say_where() {
    let header = |line, expected, found: &str| MapError::Header { line, expected, found: found.into() };
    let cases: [(&str, MapError); 11] = [
        ("", MapError::NotThisFormat("rohrpost-map 1")),
        ("type octile\n", MapError::NotThisFormat("rohrpost-map 1")),
        ("rohrpost-map 1\n", MapError::Ended { line: 1, missing: "the line `map`" }),
        ("rohrpost-map 1\nmap\n#>#\n", MapError::Ended { line: 2, missing: "the line `cell_m` and metres" }),
        ("rohrpost-map 1\ncell_m -1\nmap\n", header(2, "a positive number of metres", "-1")),
        ("rohrpost-map 1\ncell_m nan\nmap\n", header(2, "a positive number of metres", "nan")),
        ("rohrpost-map 1\nsize 3\n", header(2, "`cell_m` and metres, or `map`", "size 3")),
        ("rohrpost-map 1\ncell_m 1\nmap\n", MapError::Ended { line: 3, missing: "all of its rows" }),
        ("rohrpost-map 1\ncell_m 1\nmap\n###\n#>\n", MapError::RowLength { line: 5, found: 2, expected: 3 }),
        ("rohrpost-map 1\ncell_m 1\nmap\n#x#\n", MapError::Square { line: 4, column: 2, found: 'x' }),
        ("rohrpost-map 1\ncell_m 1\nmap\n#>#\n#<#\n", MapError::SecondStart { line: 5 }),
    ];
    for (text, error) in cases {
        assert_eq!(World::parse(text), Err(error), "{text:?}");
    }
    assert_eq!(World::parse("rohrpost-map 1\ncell_m 1\nmap\n# #\n"), Err(MapError::NoStart));
}

const OCTILE: &str = "type octile\nheight 3\nwidth 5\nmap\nTT@TT\nT..OT\nTTTTT\n";

#[test]
fn octile_start_is_free() {
    let world = World::parse_octile(OCTILE, 2.0).unwrap();
    assert_eq!(world.start(), Pose { x_m: 5.0, y_m: 3.0, heading_rad: 0.0 }, "the middle itself is free");
}

#[test]
fn bad_octile_maps_say_where() {
    for (text, error) in [
        ("rohrpost-map 1\n", MapError::NotThisFormat("type octile")),
        ("type octile\nheight x\n", MapError::Header { line: 2, expected: "height", found: "height x".into() }),
        ("type octile\nheight 2\nwidth 2\nmap\nT.\n", MapError::Ended { line: 5, missing: "all of its rows" }),
        ("type octile\nheight 1\nwidth 2\nmap\nT.\nTT\n", MapError::TooLarge { line: 6 }),
        ("type octile\nheight 1\nwidth 2\nmap\nT.T\n", MapError::RowLength { line: 5, found: 3, expected: 2 }),
        ("type octile\nheight 1\nwidth 2\nmap\nTT\n", MapError::NoStart),
    ] {
        assert_eq!(World::parse_octile(text, 1.0), Err(error), "{text:?}");
    }
    assert_eq!(World::parse_octile(OCTILE, 0.0), Err(MapError::CellSize(0.0)));
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
