//! The shortest path between cells, or why there is none.

use super::cell::{Cell, Direction};
use super::obstacle::Obstacle;
use super::squares::{Grid, Square};
use super::wave::Wave;
use thiserror::Error;

/// Obstacles that a message names.
const NAMED_MAX: usize = 8;

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NoPath {
    /// Start or goal is no path.
    #[error("{cell} is {found}; a robot starts and ends on a path")]
    NotAPath {
        /// Start or goal.
        cell: Cell,
        /// What the grid has there.
        found: &'static str,
    },
    /// Walls or blanks are between them everywhere.
    #[error("no path leads from {start} to there, also without robots and intruders: walls and blanks part them")]
    Parted {
        /// The start.
        start: Cell,
    },
    /// Without these obstacles there would be a path. They are those that the wave came to.
    #[error("the paths from {start} to there are blocked by {}", named(obstacles))]
    Blocked {
        /// The start.
        start: Cell,
        /// At the border of what can be reached.
        obstacles: Vec<Obstacle>,
    },
}

fn named(obstacles: &[Obstacle]) -> String {
    let more = obstacles.len().saturating_sub(NAMED_MAX);
    let named = obstacles.iter().take(NAMED_MAX).map(ToString::to_string);
    named.chain((more > 0).then(|| format!("{more} more"))).collect::<Vec<_>>().join(", ")
}

/// The cells of the shortest path to the nearest goal, from the start to the goal. Of several as short, the first one
/// in the order of [`Direction::ALL`] where they part. Obstacles on the start do not hold.
///
/// # Errors
/// Why there is none.
pub fn shortest_path(
    wave: &mut Wave,
    grid: &Grid,
    start: Cell,
    goals: &[Cell],
    obstacles: &[Obstacle],
) -> Result<Vec<Cell>, NoPath> {
    for cell in [start].iter().chain(goals) {
        check_path(grid, *cell)?;
    }
    wave.start(grid, start, goals.iter().copied(), obstacles.iter().copied());
    let Some(goal) = wave.next_goal() else { return Err(why_none(wave, grid, start, goals, obstacles)) };
    let mut path: Vec<Cell> = wave.back_from(goal).collect();
    path.reverse();
    Ok(path)
}

/// # Errors
/// If no robot can be in this cell.
pub(super) fn check_path(grid: &Grid, cell: Cell) -> Result<(), NoPath> {
    if grid.is_path(cell) {
        return Ok(());
    }
    let found = grid.square(cell).map_or("outside of the map", Square::words);
    Err(NoPath::NotAPath { cell, found })
}

/// After a wave that found no goal.
fn why_none(wave: &mut Wave, grid: &Grid, start: Cell, goals: &[Cell], obstacles: &[Obstacle]) -> NoPath {
    let is_reached = |cell: Option<Cell>| cell.is_some_and(|cell| wave.distance(cell).is_some());
    let is_at_border = |obstacle: &&Obstacle| {
        let around = Direction::ALL.into_iter().any(|step| is_reached(obstacle.cell.next(step)));
        around && !is_reached(Some(obstacle.cell))
    };
    let blocking = obstacles.iter().filter(is_at_border).copied().collect();
    wave.start(grid, start, goals.iter().copied(), []);
    match wave.next_goal() {
        Some(_) => NoPath::Blocked { start, obstacles: blocking },
        None => NoPath::Parted { start },
    }
}
