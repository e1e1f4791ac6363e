//! The seed's own examples of waves, paths and entrances.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_team::grid::{Cell, Entrance, Map, NoPath, Obstacle, Wave, entrances, shortest_path};

fn grid(text: &str) -> Map {
    Map::read(text.as_bytes()).unwrap()
}

fn cell(text: &str) -> Cell {
    text.parse().unwrap()
}

/// The cells of the path with these obstacles, or why there is none.
fn path(text: &str, from: &str, to: &[&str], obstacles: &str) -> Result<String, String> {
    let map = grid(text);
    let obstacles = Obstacle::read(obstacles.as_bytes(), &map.grid).unwrap();
    let goals: Vec<Cell> = to.iter().map(|to| cell(to)).collect();
    let path = shortest_path(&mut Wave::default(), &map.grid, cell(from), &goals, &obstacles);
    let path = path.map_err(|error| error.to_string())?;
    Ok(path.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "))
}

const ROOM: &str = ".....\n.....\n.....\n";
const ALLEY: &str = "....\n";

#[test]
fn of_equal_paths_the_one_north_before_east_before_south_before_west_counts() {
    for (from, to, cells) in [
        ("0,2", "2,0", "0,2 0,1 0,0 1,0 2,0"),
        ("0,0", "2,2", "0,0 1,0 2,0 2,1 2,2"),
        ("4,0", "2,2", "4,0 4,1 4,2 3,2 2,2"),
        ("4,2", "2,0", "4,2 4,1 4,0 3,0 2,0"),
        ("1,1", "1,1", "1,1"),
    ] {
        assert_eq!(path(ROOM, from, &[to], ""), Ok(cells.into()));
    }
    assert_eq!(path(ROOM, "2,1", &["1,1", "3,1", "2,2", "2,0"], ""), Ok("2,1 2,0".into()));
    assert_eq!(path(ROOM, "2,1", &["1,1", "2,2"], ""), Ok("2,1 2,2".into()));
    assert_eq!(path(ROOM, "2,1", &["0,0", "4,1"], ""), Ok("2,1 3,1 4,1".into()), "the nearest goal");
}

#[test]
fn obstacles_hold_a_wave_as_table_3_1_says() {
    let whole = Ok("0,0 1,0 2,0 3,0".to_owned());
    let blocked = |what: &str| Err(format!("the paths from 0,0 to there are blocked by {what}"));
    for (obstacles, answer) in [
        ("2,0 E", whole.clone()),
        ("2,0 W", blocked("a robot at 2,0 that moves W")),
        ("2,0 N", blocked("a robot at 2,0 that moves N")),
        ("2,0 S", blocked("a robot at 2,0 that moves S")),
        ("2,0 stopped", blocked("a stopped robot at 2,0")),
        ("2,0 intruder", blocked("an intruder at 2,0")),
        ("2,0 E\n2,0 stopped", blocked("a robot at 2,0 that moves E, a stopped robot at 2,0")),
        ("3,0 stopped", blocked("a stopped robot at 3,0")),
        ("0,0 stopped # the robot itself", whole.clone()),
        ("1,0 E\n2,0 E\n3,0 E", whole),
    ] {
        assert_eq!(path(ALLEY, "0,0", &["3,0"], obstacles), answer, "{obstacles}");
    }
}

/// Figure 3.11: R1 stands, R2 goes up as the wave does, R3 goes left against it.
#[test]
fn a_wave_follows_the_robot_that_moves_with_it() {
    let text = ".....\n. . .\n. . .\n.....\n";
    let robots = "0,2 stopped\n2,1 N\n4,2 W\n";
    assert_eq!(path(text, "2,3", &["2,0"], robots), Ok("2,3 2,2 2,1 2,0".into()));
    let against = "0,2 stopped\n2,1 S\n4,2 W\n";
    let why = "the paths from 2,3 to there are blocked by a stopped robot at 0,2, a robot at 2,1 that moves S, a robot \
               at 4,2 that moves W";
    assert_eq!(path(text, "2,3", &["2,0"], against), Err(why.into()));
}

/// With a robot at 1,1 that moves east, both 1,0 and 0,1 are one step from the start, but only from 0,1 a wave enters
/// 1,1. Labels alone lead back to 1,0.
#[test]
fn a_path_is_not_led_back_across_a_forbidden_edge() {
    let text = "....\n....\n";
    assert_eq!(path(text, "0,0", &["1,1"], "1,1 E"), Ok("0,0 0,1 1,1".into()));
    assert_eq!(path(text, "0,0", &["1,1"], "1,1 S"), Ok("0,0 1,0 1,1".into()));
    let around = "0,0 1,0 2,0 2,1 1,1";
    assert_eq!(path(text, "0,0", &["1,1"], "1,1 W"), Ok(around.into()));
}

#[test]
fn why_there_is_no_path_is_told() {
    let parted = "no path leads from 0,0 to there, also without robots and intruders: walls and blanks part them";
    for (from, to, why) in [
        ("0,0", "4,0", parted),
        ("1,0", "4,0", "1,0 is a wall; a robot starts and ends on a path"),
        ("0,0", "2,0", "2,0 is a blank; a robot starts and ends on a path"),
        ("0,0", "0,9", "0,9 is outside of the map; a robot starts and ends on a path"),
        (
            "4294967295,4294967295",
            "0,0",
            "4294967295,4294967295 is outside of the map; a robot starts and ends on a path",
        ),
    ] {
        assert_eq!(path(".* ..\n", from, &[to], "4,0 stopped"), Err(why.into()));
    }
    let told = path(ALLEY, "0,0", &["3,0"], &"1,0 stopped\n".repeat(18)).unwrap_err();
    assert!(told.ends_with("a stopped robot at 1,0, 10 more") && told.len() < 300, "{told}");
}

fn entrances_of(
    text: &str,
    intruder: &[&str],
    robot: &str,
    obstacles: &str,
) -> Result<Vec<(String, Option<u32>)>, NoPath> {
    let map = grid(text);
    let obstacles = Obstacle::read(obstacles.as_bytes(), &map.grid).unwrap();
    let body: Vec<Cell> = intruder.iter().map(|part| cell(part)).collect();
    let found = entrances(&mut Wave::default(), &map.grid, &body, cell(robot), &obstacles)?;
    Ok(found.into_iter().map(|Entrance { cell, distance }| (cell.to_string(), distance)).collect())
}

#[test]
fn entrances_come_with_their_distances_the_nearest_first() {
    let ring = ".....\n.***.\n.....\n";
    let of = |entrances: &[(&str, Option<u32>)]| Ok(entrances.iter().map(|(cell, d)| ((*cell).into(), *d)).collect());
    let side = [("4,0", Some(4)), ("4,2", Some(6))];
    assert_eq!(entrances_of(ring, &["4,1"], "0,0", ""), of(&side));
    let closed = [("4,2", Some(6)), ("4,0", None)];
    assert_eq!(entrances_of(ring, &["4,1"], "0,0", "2,0 stopped"), of(&closed), "no way leads through the intruder");
    let large = [("3,0", Some(3)), ("3,2", Some(5)), ("4,2", Some(6))];
    assert_eq!(entrances_of(ring, &["4,1", "4,0", "3,1"], "0,0", ""), of(&large), "of three cells");
    assert_eq!(entrances_of(ring, &["1,1"], "0,1", ""), of(&[("0,1", Some(0)), ("1,0", Some(2)), ("1,2", Some(2))]));
    assert_eq!(entrances_of(ring, &["9,9"], "0,0", ""), of(&[]));
    let outside = entrances_of(ring, &["0,0"], "1,1", "").unwrap_err();
    assert_eq!(outside.to_string(), "1,1 is a wall; a robot starts and ends on a path");
}
