//! The entrances of an intruder: the paths beside it, from which a team closes it in.

use super::cell::{Cell, Direction};
use super::obstacle::{Obstacle, ObstacleKind};
use super::path::{NoPath, check_path};
use super::squares::Grid;
use super::wave::Wave;

/// A path beside an intruder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entrance {
    /// The path.
    pub cell: Cell,
    /// Steps from the robot to there; `None` if walls, robots or the intruder itself are between them.
    pub distance: Option<u32>,
}

/// The paths beside an intruder of these cells, nearest first; of several as near, the one first that the shortest path
/// to any of them leads to. Those that the robot cannot reach come last, in the order of the file. No path leads
/// through the intruder.
///
/// # Errors
/// If the robot's own cell is no path.
pub fn entrances(
    wave: &mut Wave,
    grid: &Grid,
    intruder: &[Cell],
    robot: Cell,
    obstacles: &[Obstacle],
) -> Result<Vec<Entrance>, NoPath> {
    check_path(grid, robot)?;
    let in_file = |cell: &Cell| (cell.row, cell.column);
    let mut body = intruder.to_vec();
    body.sort_unstable_by_key(in_file);
    let is_body = |cell: &Cell| body.binary_search_by_key(&in_file(cell), in_file).is_ok();
    let beside = body.iter().flat_map(|cell| Direction::ALL.into_iter().filter_map(|step| cell.next(step)));
    let mut beside: Vec<Cell> = beside.filter(|cell| grid.is_path(*cell) && !is_body(cell)).collect();
    beside.sort_unstable_by_key(in_file);
    beside.dedup();
    let body = body.iter().map(|cell| Obstacle { cell: *cell, kind: ObstacleKind::Intruder });
    wave.start(grid, robot, beside.iter().copied(), obstacles.iter().copied().chain(body));
    let mut found = Vec::with_capacity(beside.len());
    while let Some(cell) = wave.next_goal() {
        found.push(Entrance { cell, distance: wave.distance(cell) });
    }
    let unreached = beside.into_iter().filter(|cell| wave.distance(*cell).is_none());
    found.extend(unreached.map(|cell| Entrance { cell, distance: None }));
    Ok(found)
}
