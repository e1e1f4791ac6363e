//! Maps of the three formats, lists of obstacles, and what is told of their mistakes.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_team::grid::{CELLS_MAX, Cell, Direction, Format, Map, MapError, Obstacle, ObstacleKind, Square};

const GLOBAL: &str = "*******\n*     *\n* .R. *\n* . . *\n* .I. *\n*     *\n*******\n";

fn at(column: u32, row: u32) -> Cell {
    Cell { column, row }
}

fn read(text: &str) -> Map {
    Map::read(text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// Rows with a letter for each square.
fn drawn(map: &Map) -> Vec<String> {
    let letter = |square: &Square| match square {
        Square::Path => 'p',
        Square::Wall => 'w',
        Square::Blank => '-',
    };
    map.grid.rows_of_squares().map(|row| row.iter().map(letter).collect()).collect()
}

#[test]
fn each_format_is_read_as_drawn() {
    let map = read(GLOBAL);
    assert_eq!(drawn(&map)[1..4], ["w-----w", "w-ppp-w", "w-p-p-w"]);
    assert_eq!((map.format, map.cell_m), (Format::Drawn, None));
    assert_eq!((map.robots, map.intruders), (vec![(at(3, 2), None)], vec![at(3, 4)]));
    let map = read("type octile\nheight 2\nwidth 6\nmap\n@.GSWT\nO.....\n");
    assert_eq!((drawn(&map), map.format, map.cell_m), (vec!["wpppww".into(), "wppppp".into()], Format::MovingAi, None));
    let map = read("rohrpost-map 1\n\n# a remark\ncell_m 0.5\nmap\n#####\n#> v#\n#.^<#\n");
    assert_eq!(drawn(&map), ["wwwww", "wpppw", "wpppw"]);
    assert_eq!((map.format, map.cell_m, map.line_and_column(at(3, 1))), (Format::Rohrpost, Some(0.5), (7, 4)));
    let facing = [(1, 1, Direction::East), (3, 1, Direction::South), (2, 2, Direction::North), (3, 2, Direction::West)];
    assert_eq!(map.robots, facing.map(|(column, row, facing)| (at(column, row), Some(facing))));
}

#[test]
fn what_editors_do_to_a_file_does_no_harm() {
    let plain = read(GLOBAL);
    for text in
        [GLOBAL.replace('\n', "\r\n"), format!("\u{feff}{GLOBAL}"), format!("{GLOBAL}\n\n"), GLOBAL.trim_end().into()]
    {
        assert_eq!(read(&text), plain);
    }
    let text = "    *\n\n .\n";
    assert_eq!(drawn(&read(text)), ["----w", "-----", "-p---"], "rows may end early");
    assert_eq!(read("type octile \nwidth 2\nheight 1 \nmap\n.T\n").grid.columns(), 2);
}

#[test]
fn each_mistake_of_a_map_is_told_with_line_column_and_what_would_be_right() {
    let drawn = "expected `*` (wall), `.` (path), a blank (neither), `R` (robot) or `I` (intruder)";
    let own = "expected `#` (wall), `.` or a blank (path), `>`, `^`, `<` or `v` (robot)";
    let octile = "expected `.`, `G` or `S` (path), `@`, `O`, `T` or `W` (wall)";
    let begin = "line 1, column 1: expected `rohrpost-map 1`, `type octile`, or the first row of a drawn map (`*` \
                 wall, `.` path, blank); found";
    for (text, told) in [
        ("", format!("{begin} ``")),
        ("\n\n", format!("{begin} ``")),
        ("rohrpost-map 2\n", format!("{begin} `rohrpost-map 2`")),
        ("#####\n", format!("{begin} `#####`")),
        ("type tile\n", format!("{begin} `type tile`")),
        ("***\n*x*\n", format!("line 2, column 2: `x` is no square; {drawn}")),
        ("***\n*\t*\n", format!("line 2, column 2: `\\t` is no square; {drawn}")),
        ("***\n. ü\n", format!("line 2, column 3: `ü` is no square; {drawn}")),
        (
            "rohrpost-map 1\n",
            "line 1, column 15: the map ends here; expected `cell_m` and metres, then the line `map`".into(),
        ),
        ("rohrpost-map 1\nmap\n#\n", "line 2, column 1: expected `cell_m` and metres before `map`; found `map`".into()),
        ("rohrpost-map 1\nsize 3\n", "line 2, column 1: expected `cell_m` and metres; found `size 3`".into()),
        (
            "rohrpost-map 1\ncell_m 0\n",
            "line 2, column 1: expected `cell_m` and a positive number of metres; found `cell_m 0`".into(),
        ),
        (
            "rohrpost-map 1\ncell_m nan\n",
            "line 2, column 1: expected `cell_m` and a positive number of metres; found `cell_m nan`".into(),
        ),
        (
            "rohrpost-map 1\ncell_m 1\ncell_m 2\n",
            "line 3, column 1: expected `cell_m` and metres; found `cell_m 2`".into(),
        ),
        (
            "rohrpost-map 1\ncell_m 1\nmap\n\n",
            "line 3, column 4: the map ends here; expected rows of squares below the line `map`".into(),
        ),
        ("rohrpost-map 1\ncell_m 1\nmap\n###\n#>\n", "line 5, column 3: the row has 2 squares; expected 3".into()),
        ("rohrpost-map 1\ncell_m 1\nmap\n##\n\n##\n", "line 5, column 1: the row has 0 squares; expected 2".into()),
        ("rohrpost-map 1\ncell_m 1\nmap\n#*#\n", format!("line 4, column 2: `*` is no square; {own}")),
        (
            "type octile\nheight x\n",
            "line 2, column 1: expected `height` and a positive number of rows; found `height x`".into(),
        ),
        (
            "type octile\nheight 1\nwidth -2\n",
            "line 3, column 1: expected `width` and a positive number of columns; found `width -2`".into(),
        ),
        (
            "type octile\nheight 1\nmap\n.\n",
            "line 3, column 1: expected `height` and `width` with a number each before `map`; found `map`".into(),
        ),
        (
            "type octile\nheight 3\nwidth 2\nmap\nT.\n",
            "line 5, column 3: the map ends here; expected 2 more rows, as `height` says".into(),
        ),
        (
            "type octile\nheight 1\nwidth 2\nmap\nT.\nTT\n",
            "line 6, column 1: a row too many; expected 1 rows, as `height` says".into(),
        ),
        ("type octile\nheight 1\nwidth 2\nmap\nT.T\n", "line 5, column 3: the row has 3 squares; expected 2".into()),
        ("type octile\nheight 1\nwidth 2\nmap\nT#\n", format!("line 5, column 2: `#` is no square; {octile}")),
    ] {
        let error = Map::read(text.as_bytes()).unwrap_err();
        assert_eq!(error.to_string(), told, "{text:?}");
    }
}

#[test]
fn bytes_that_are_no_text_are_told_where_they_stand() {
    let told = |bytes: &[u8]| Map::read(bytes).unwrap_err().to_string();
    assert!(told(b"**\n*\xff\n").starts_with("line 2, column 2: `\u{fffd}` is no square"));
    assert!(told(b"\xff").starts_with("line 1, column 1: "));
    assert!(told(b"***\n*\0*\n").starts_with("line 2, column 2: `\\0` is no square"));
}

#[test]
fn huge_maps_are_refused_before_they_take_memory() {
    let wide = "*".repeat(CELLS_MAX);
    assert_eq!(read(&wide).grid.columns() as usize, CELLS_MAX);
    let too_large = |line, columns, rows| Err(MapError::TooLarge { line, columns, rows });
    assert_eq!(Map::read(format!("*{wide}").as_bytes()), too_large(1, CELLS_MAX + 1, 1));
    assert_eq!(Map::read(format!("{wide}\n*").as_bytes()), too_large(1, CELLS_MAX, 2));
    let own = format!("rohrpost-map 1\ncell_m 1\nmap\n#{}", wide.replace('*', "#"));
    assert_eq!(Map::read(own.as_bytes()), too_large(4, CELLS_MAX + 1, 1));
    let octile = |columns: usize, rows: usize| {
        Map::read(format!("type octile\nheight {rows}\nwidth {columns}\nmap\n.\n").as_bytes())
    };
    assert_eq!(octile(CELLS_MAX, 2), too_large(4, CELLS_MAX, 2));
    assert_eq!(octile(usize::MAX, usize::MAX), too_large(4, usize::MAX, usize::MAX));
}

#[test]
fn paths_too_close_to_walls_and_bounds_are_told_one_by_one() {
    let told = |text: &str| read(text).too_close().map(|close| close.to_string()).collect::<Vec<_>>();
    let none: [String; 0] = [];
    assert_eq!(told(GLOBAL), none);
    assert_eq!(
        told("    \n *  \n  . \n   .\n"),
        [
            "line 3, column 3: a path beside the wall at line 2, column 2; expected a blank between",
            "line 4, column 4: a path beside the bound of the map; expected a blank between",
        ]
    );
    assert_eq!(told("type octile\nheight 1\nwidth 2\nmap\n.T\n"), none, "a rule of drawn maps alone");
}

#[test]
fn two_maps_of_one_world_agree_or_the_first_difference_is_told() {
    let local = read("*******\n*     *\n* ... *\n* . . *\n* ... *\n*     *\n*******\n");
    assert_eq!(local.agrees_with(&read(GLOBAL)), Ok(()));
    assert_eq!(read("   *\n .\n").agrees_with(&read("   *\n .  \n")), Ok(()), "blanks at the end may be left out");
    for (global, told) in [
        (
            GLOBAL.replacen("R.", "R*", 1),
            "line 3, column 5: a path in the local map, a wall in the global one; expected the same",
        ),
        (
            GLOBAL.replacen("*******\n", "********\n", 1),
            "line 1, column 8: a blank in the local map, a wall in the global one; expected the same",
        ),
        (
            format!("{GLOBAL} \n"),
            "line 8, column 1: no row in the local map, a blank in the global one; expected the same",
        ),
    ] {
        assert_eq!(local.agrees_with(&read(&global)).unwrap_err().to_string(), told);
    }
}

#[test]
fn lists_of_obstacles_are_read_and_their_mistakes_told() {
    let grid = read("      \n .... \n   *  \n").grid;
    let text = "# robots\n\n1,1 N\n 2,1\tstopped # waits\r\n3,1 intruder\n3,1 W\n";
    let kinds = [ObstacleKind::Moving(Direction::North), ObstacleKind::Stopped, ObstacleKind::Intruder];
    let kinds = kinds.into_iter().chain([ObstacleKind::Moving(Direction::West)]);
    let cells = [at(1, 1), at(2, 1), at(3, 1), at(3, 1)];
    let obstacles: Vec<Obstacle> = cells.into_iter().zip(kinds).map(|(cell, kind)| Obstacle { cell, kind }).collect();
    assert_eq!(Obstacle::read(text.as_bytes(), &grid), Ok(obstacles));
    let right = "expected column,row and N, E, S, W, `stopped` or `intruder`, such as `3,4 N`; found";
    for (text, told) in [
        ("1,1\n", format!("line 1, column 4: {right} ``")),
        ("\n1,1 north\n", format!("line 2, column 5: {right} `north`")),
        ("  1;1 N\n", format!("line 1, column 3: {right} `1;1 N`")),
        ("1,1 N N\n", format!("line 1, column 5: {right} `N N`")),
        ("-1,1 N\n", format!("line 1, column 1: {right} `-1,1 N`")),
        ("3,2 N\n", "line 1, column 1: 3,2 is a wall; expected a path".into()),
        (" 0,0 N\n", "line 1, column 2: 0,0 is a blank; expected a path".into()),
        ("1,1 E\n9,9 N\n", "line 2, column 1: 9,9 is outside of the map; expected a path".into()),
    ] {
        assert_eq!(Obstacle::read(text.as_bytes(), &grid).unwrap_err().to_string(), told, "{text:?}");
    }
    assert!(Obstacle::read(b"\xff\xfe", &grid).is_err());
}

#[test]
fn robots_are_obstacles_by_heading_and_speed() {
    let kind = |heading_rad, speed_m_s| Obstacle::robot(at(0, 0), heading_rad, speed_m_s).kind;
    let (east, west) = (ObstacleKind::Moving(Direction::East), ObstacleKind::Moving(Direction::West));
    assert_eq!((kind(0.1, 0.5), kind(0.1, -0.5), kind(0.1, 0.0)), (east, west, ObstacleKind::Stopped));
    for (heading_rad, speed_m_s) in [(f64::NAN, 1.0), (0.0, f64::NAN), (0.0, f64::INFINITY)] {
        assert_eq!(kind(heading_rad, speed_m_s), ObstacleKind::Stopped);
    }
}
