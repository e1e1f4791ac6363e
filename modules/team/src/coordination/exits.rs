//! Exits of intruders and the paths behind them: how much they matter, and how far robots have to there.

use super::assignment::Way;
use super::post::{Post, Target};
use crate::grid::{Cell, Direction, Grid, Obstacle, Wave};
use std::collections::BTreeSet;

/// A path beside an intruder.
#[derive(Clone, Debug)]
pub(super) struct Exit {
    pub(super) post: Post,
    pub(super) cell: Cell,
    /// Paths that an intruder can reach through it, the exit included; robots do not count.
    pub(super) reaches: u32,
    /// From each robot, in the order in which they were given.
    pub(super) ways: Vec<Way>,
}

/// The exits of all intruders, in the order of intruders and of the file. Of a path beside several intruders, the first
/// one counts. `bodies` are cells of intruders, `blocked` also those of robots that stand.
pub(super) fn exits(
    wave: &mut Wave,
    grid: &Grid,
    intruders: &[&Target],
    bodies: &[Obstacle],
    blocked: &[Obstacle],
    robots: impl Iterator<Item = Cell> + Clone,
) -> Vec<Exit> {
    let mut seen: BTreeSet<Cell> = bodies.iter().map(|body| body.cell).collect();
    let mut found = Vec::new();
    for intruder in intruders {
        let around = intruder.cells.iter().flat_map(|cell| Direction::ALL.into_iter().filter_map(|it| cell.next(it)));
        let mut around: Vec<Cell> = around.filter(|cell| grid.is_path(*cell)).collect();
        around.sort_unstable_by_key(|cell| (cell.row, cell.column));
        for cell in around {
            if !seen.insert(cell) {
                continue;
            }
            spread(wave, grid, cell, bodies);
            let reaches = reached(wave, grid).count() as u32;
            // What is blocked stands, so a way is as long there as back.
            spread(wave, grid, cell, blocked);
            let is_barred = blocked.iter().any(|obstacle| obstacle.cell == cell);
            let ways = robots.clone().map(|robot| wave.distance(robot).filter(|_| !is_barred)).collect();
            found.push(Exit { post: Post::beside(intruder, cell), cell, reaches, ways });
        }
    }
    found
}

/// A path behind exits.
#[derive(Clone, Debug)]
pub(super) struct Behind {
    /// To the nearest exit.
    pub(super) steps: u32,
    pub(super) cell: Cell,
    /// From each robot, in the order in which they were given.
    pub(super) ways: Vec<Way>,
}

/// The paths nearest behind exits, at least as many as robots if there are so many: all that are as near as the last of
/// them. In the order of the file.
pub(super) fn behind(
    wave: &mut Wave,
    grid: &Grid,
    exits: &[Cell],
    blocked: &[Obstacle],
    robots: impl ExactSizeIterator<Item = Cell>,
) -> Vec<Behind> {
    let mut near: Vec<Behind> = Vec::new();
    for exit in exits {
        spread(wave, grid, *exit, blocked);
        let behind = reached(wave, grid).filter(|(cell, _)| !exits.contains(cell));
        near.extend(behind.map(|(cell, steps)| Behind { steps, cell, ways: Vec::new() }));
    }
    near.sort_unstable_by_key(|it| (it.cell.row, it.cell.column, it.steps));
    near.dedup_by_key(|it| it.cell);
    let mut steps: Vec<u32> = near.iter().map(|it| it.steps).collect();
    steps.sort_unstable();
    if let Some(last) = robots.len().checked_sub(1).and_then(|last| steps.get(last)) {
        near.retain(|it| it.steps <= *last);
    }
    for robot in robots {
        spread(wave, grid, robot, blocked);
        near.iter_mut().for_each(|it| it.ways.push(wave.distance(it.cell)));
    }
    near
}

/// Spreads a wave over all that it reaches.
fn spread(wave: &mut Wave, grid: &Grid, start: Cell, blocked: &[Obstacle]) {
    wave.start(grid, start, [], blocked.iter().copied());
    wave.next_goal();
}

/// The cells that a wave has reached, and their distances.
fn reached<'a>(wave: &'a Wave, grid: &'a Grid) -> impl Iterator<Item = (Cell, u32)> + use<'a> {
    grid.cells().filter_map(|(cell, _)| Some((cell, wave.distance(cell)?)))
}
