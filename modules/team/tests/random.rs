//! Paths, distances and entrances on random maps with robots and intruders, beside a search that is obviously right.
//!
//! `ROHRPOST_GRID_MAPS=10000 cargo test -p rohrpost-team --test random` tries as many maps.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod support;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_team::grid::{
    Cell, Direction, Grid, NoPath, Obstacle, ObstacleKind, Square, Wave, entrances, shortest_path,
};

/// Longest side of a map.
const SIDE_MAX: u32 = 12;

fn maps() -> u64 {
    std::env::var("ROHRPOST_GRID_MAPS").map_or(1_000, |maps| maps.parse().expect("a number of maps"))
}

/// One map with what moves on it, the same for the same number.
struct Scene {
    grid: Grid,
    obstacles: Vec<Obstacle>,
    start: Cell,
    goals: Vec<Cell>,
    intruder: Vec<Cell>,
}

impl Scene {
    fn new(number: u64) -> Self {
        let mut chance = ChaCha8Rng::seed_from_u64(number);
        let (columns, rows) = (chance.random_range(1..=SIDE_MAX), chance.random_range(1..=SIDE_MAX));
        let (walls, blanks) = (chance.random_range(0.0..0.4), chance.random_range(0.0..0.2));
        let squares = (0..columns * rows).map(|_| match chance.random::<f64>() {
            share if share < walls => Square::Wall,
            share if share < walls + blanks => Square::Blank,
            _ => Square::Path,
        });
        let grid = Grid::new(columns, squares.collect()).unwrap();
        // Some stand outside of the map.
        let cell = |chance: &mut ChaCha8Rng| Cell {
            column: chance.random_range(0..=columns),
            row: chance.random_range(0..=rows),
        };
        let obstacles = (0..chance.random_range(0..16)).map(|_| Obstacle {
            cell: cell(&mut chance),
            kind: match chance.random_range(0..6) {
                0 => ObstacleKind::Intruder,
                1 => ObstacleKind::Stopped,
                step => ObstacleKind::Moving(Direction::ALL[step - 2]),
            },
        });
        let obstacles = obstacles.collect();
        let mut cells = |most| (0..chance.random_range(1..=most)).map(|_| cell(&mut chance)).collect::<Vec<_>>();
        let (start, goals, intruder) = (cells(1)[0], cells(3), cells(4));
        Self { grid, obstacles, start, goals, intruder }
    }
}

#[test]
fn paths_and_entrances_are_those_of_a_search_that_is_obviously_right() {
    // One wave for all: what an earlier map left must not matter.
    let mut wave = Wave::default();
    let (mut found, mut blocked, mut parted, mut strayed) = (0u32, 0u32, 0u32, 0u32);
    for number in 0..maps() {
        let scene = Scene::new(number);
        let Scene { grid, obstacles, start, goals, .. } = &scene;
        let labels = support::distances(grid, obstacles, *start);
        wave.start(grid, *start, [], obstacles.iter().copied());
        assert_eq!(wave.next_goal(), None, "map {number}");
        for (cell, _) in grid.cells() {
            assert_eq!(wave.distance(cell), labels.get(&cell).copied(), "map {number}, {cell}");
        }
        strayed += u32::from(goals.iter().any(|goal| labels_alone_cross_a_forbidden_edge(&scene, &labels, *goal)));
        let slow = support::path(grid, obstacles, *start, goals);
        match shortest_path(&mut wave, grid, *start, goals, obstacles) {
            Ok(path) => {
                assert_eq!(Some(path), slow, "map {number}");
                found += 1;
            }
            Err(NoPath::NotAPath { cell, .. }) => assert!(!grid.is_path(cell), "map {number}"),
            Err(NoPath::Blocked { obstacles, .. }) => {
                assert_eq!(slow, None, "map {number}");
                assert!(!obstacles.is_empty(), "map {number}");
                assert!(support::path(grid, &[], *start, goals).is_some(), "map {number}");
                blocked += 1;
            }
            Err(NoPath::Parted { .. }) => {
                assert_eq!(support::path(grid, &[], *start, goals), None, "map {number}");
                parted += 1;
            }
        }
        check_entrances(&mut wave, &scene, number);
    }
    assert!(found > 0 && blocked > 0 && parted > 0 && strayed > 0, "{found} {blocked} {parted} {strayed}");
}

fn check_entrances(wave: &mut Wave, scene: &Scene, number: u64) {
    let Scene { grid, obstacles, start, intruder, .. } = scene;
    let Ok(found) = entrances(wave, grid, intruder, *start, obstacles) else {
        return assert!(!grid.is_path(*start), "map {number}");
    };
    let body = intruder.iter().map(|cell| Obstacle { cell: *cell, kind: ObstacleKind::Intruder });
    let all: Vec<Obstacle> = obstacles.iter().copied().chain(body).collect();
    let is_beside = |cell: Cell| {
        let around = Direction::ALL.into_iter().filter_map(|step| cell.next(step));
        grid.is_path(cell) && !intruder.contains(&cell) && around.into_iter().any(|cell| intruder.contains(&cell))
    };
    let beside: Vec<Cell> = grid.cells().map(|(cell, _)| cell).filter(|cell| is_beside(*cell)).collect();
    let mut cells: Vec<Cell> = found.iter().map(|entrance| entrance.cell).collect();
    let nearest = support::path(grid, &all, *start, &beside).and_then(|path| path.last().copied());
    let reached = found.iter().take_while(|entrance| entrance.distance.is_some()).count();
    assert_eq!(nearest, cells.first().copied().filter(|_| reached > 0), "map {number}");
    cells.sort_unstable_by_key(|cell| (cell.row, cell.column));
    assert_eq!(cells, beside, "map {number}");
    let labels = support::distances(grid, &all, *start);
    assert!(found.iter().all(|entrance| entrance.distance == labels.get(&entrance.cell).copied()), "map {number}");
    assert!(found[..reached].is_sorted_by_key(|entrance| entrance.distance), "map {number}");
    assert!(found[reached..].iter().all(|entrance| entrance.distance.is_none()), "map {number}");
}

/// Whether the descent of seed 000, 2.4.2, which looks at labels alone, takes an edge that a robot forbids.
fn labels_alone_cross_a_forbidden_edge(scene: &Scene, labels: &support::Labels, goal: Cell) -> bool {
    let (mut here, Some(mut label)) = (goal, labels.get(&goal).copied()) else { return false };
    while label > 0 {
        label -= 1;
        let lower = |step: &Direction| here.next(*step).is_some_and(|cell| labels.get(&cell) == Some(&label));
        let back = Direction::ALL.into_iter().find(lower).unwrap();
        let before = here.next(back).unwrap();
        if support::entered(&scene.grid, &scene.obstacles, before, back.reversed()) != Some(here) {
            return true;
        }
        here = before;
    }
    false
}
