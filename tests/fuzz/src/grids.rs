//! Maps of teams and lists of their robots: a grid, or what is wrong with the text; and paths over it.

use crate::split::texts;
use rohrpost_team::grid::{
    CELLS_MAX, Cell, Direction, Grid, Map, Obstacle, ObstacleKind, Wave, entrances, shortest_path,
};

/// Cells of a grid that paths are looked for on; larger ones would take the fuzzer's time.
const SEARCHED_MAX: u32 = 4096;

pub(crate) fn run(data: &[u8]) {
    // What is no text is a map's mistake, too.
    let (map, robots) = texts(data).map_or((data, &b""[..]), |(map, robots)| (map.as_bytes(), robots.as_bytes()));
    let map = match Map::read(map) {
        Ok(map) => map,
        Err(error) => {
            let lines = map.split(|byte| *byte == b'\n').count();
            assert!((1..=lines).contains(&error.line()) && !error.to_string().contains('\n'), "{error}");
            return;
        }
    };
    let grid = &map.grid;
    assert!(u64::from(grid.columns()) * u64::from(grid.rows()) <= CELLS_MAX as u64);
    let drawn = map.robots.iter().map(|(cell, _)| cell).chain(&map.intruders);
    assert!(drawn.into_iter().all(|cell| grid.is_path(*cell)), "robots and intruders are on paths");
    assert_eq!(map.agrees_with(&map), Ok(()));
    if let Some(close) = map.too_close().next() {
        assert!(close.line >= 1 && close.line <= grid.rows() as usize, "{close}");
    }
    let obstacles = Obstacle::read(robots, grid).unwrap_or_default();
    if grid.columns() * grid.rows() <= SEARCHED_MAX {
        search(grid, &obstacles);
    }
}

fn search(grid: &Grid, obstacles: &[Obstacle]) {
    let paths = || grid.cells().map(|(cell, _)| cell).filter(|cell| grid.is_path(*cell));
    let (Some(start), Some(goal)) = (paths().next(), paths().last()) else { return };
    let mut wave = Wave::default();
    match shortest_path(&mut wave, grid, start, &[goal], obstacles) {
        Ok(path) => {
            assert_eq!((path.first(), path.last()), (Some(&start), Some(&goal)));
            path.windows(2).for_each(|step| check_step(grid, obstacles, step[0], step[1]));
        }
        Err(none) => assert!(!none.to_string().is_empty()),
    }
    for entrance in entrances(&mut wave, grid, &[goal], start, obstacles).into_iter().flatten() {
        assert!(grid.is_path(entrance.cell) && entrance.cell != goal, "{entrance:?}");
    }
}

/// A step leads to the next path, and into no robot that moves another way.
fn check_step(grid: &Grid, obstacles: &[Obstacle], from: Cell, to: Cell) {
    let step = Direction::ALL.into_iter().find(|step| from.next(*step) == Some(to));
    let step = step.unwrap_or_else(|| panic!("{from} to {to} is no step"));
    let in_it = obstacles.iter().filter(|obstacle| obstacle.cell == to);
    assert!(grid.is_path(to) && in_it.into_iter().all(|obstacle| obstacle.kind == ObstacleKind::Moving(step)), "{to}");
}
