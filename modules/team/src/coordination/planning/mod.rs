//! Ways for many robots at once, from where they are to their goals.
//!
//! ```text
//!  Grid, Obstacles ──▶ Graph ──▶ distances to each goal ──▶ Search ──▶ moments ──▶ refine ──▶ Ways
//!                                                             └── Stepper: one step of all robots
//! ```
//!
//! - A solution is found, or it is shown that there is none, or the search is given up after a number of looks.
//! - No two robots are in one path at a moment, and no circle of robots moves at once. So the steps between two moments
//!   can be made one after the other, each into a path that is free.
//! - Robots that stand and intruders are obstacles. A robot that moves, and is not planned for, lets in what moves the
//!   same way (table 3.1 of the seed).

mod graph;
mod pibt;
mod refining;
mod search;
mod swapping;
mod timetable;

use crate::grid::{Cell, Grid, Obstacle, Square};
use graph::{Graph, NONE};
use search::{Found, Search};
use std::collections::BTreeSet;
use thiserror::Error;
use timetable::Timetable;

/// Paths of the grid times robots, at most: their distances take 4 bytes each.
pub const DISTANCES_MAX: usize = 1 << 24;
/// Moments times paths up to which a solution is refined; its table takes 8 bytes each.
const TABLE_MAX: usize = 1 << 22;
/// Groups of robots that are tried for each robot.
const TRIES: u32 = 1;

/// What one robot wants.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Trip {
    /// Where it is.
    pub from: Cell,
    /// Where it goes.
    pub to: Cell,
}

/// Why there are no ways.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
pub enum NoWays {
    /// A start or a goal is no path.
    #[error("{cell} is no path; a robot starts and ends on a path of the map")]
    NotAPath {
        /// Start or goal.
        cell: Cell,
    },
    /// Two robots in one path.
    #[error("two robots start, or end, at {cell}; give each its own path")]
    Shared {
        /// Where.
        cell: Cell,
    },
    /// One robot would not get there even if it were alone.
    #[error("walls or what stands on paths part {from} from {to}; no other robot matters")]
    Parted {
        /// Start of the robot.
        from: Cell,
        /// Goal of the robot.
        to: Cell,
    },
    /// All has been tried.
    #[error("no order of steps leads all robots to their goals; give one of them another goal")]
    Impossible,
    /// The search was given up.
    #[error("no ways were found in {looks} looks; allow more, or give some robots other goals")]
    GivenUp {
        /// Looks that were allowed.
        looks: u32,
    },
    /// Too much memory.
    #[error("{paths} paths for {robots} robots are too many; paths times robots may be {DISTANCES_MAX}")]
    TooLarge {
        /// Paths of the grid.
        paths: usize,
        /// Robots.
        robots: usize,
    },
}

/// Ways of all robots.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ways {
    moments: Vec<Vec<Cell>>,
}

impl Ways {
    /// Where all robots are at moments 0, 1, 2 and so on, in the order of their trips. At the last one all are there.
    pub fn moments(&self) -> &[Vec<Cell>] {
        &self.moments
    }

    /// Steps of all robots until they have arrived for good, those in which a robot waits included.
    pub fn steps(&self) -> u64 {
        let Some(goals) = self.moments.last() else { return 0 };
        let arrival = |(robot, goal): (usize, &Cell)| {
            self.moments.iter().rposition(|cells| cells[robot] != *goal).map_or(0, |last| last as u64 + 1)
        };
        goals.iter().enumerate().map(arrival).sum()
    }
}

/// Finds ways for all robots. `looks_max` bounds the work: looks of the search at where all robots are, each a step of
/// all. Equal arguments give equal ways on every machine.
///
/// ```
/// use rohrpost_team::coordination::{Trip, plan_ways};
/// use rohrpost_team::grid::{Cell, Map};
/// // One of two robots lets the other one pass.
/// let trip = |from, to| Trip { from: Cell { column: from, row: 0 }, to: Cell { column: to, row: 0 } };
/// let grid = Map::read(b"....\n*.**\n").unwrap().grid;
/// let ways = plan_ways(&grid, &[], &[trip(0, 3), trip(3, 0)], 1000)?;
/// assert_eq!(ways.moments().last().unwrap()[0], trip(0, 3).to);
/// # Ok::<(), rohrpost_team::coordination::NoWays>(())
/// ```
///
/// # Errors
/// Why there are none.
pub fn plan_ways(grid: &Grid, obstacles: &[Obstacle], trips: &[Trip], looks_max: u32) -> Result<Ways, NoWays> {
    check(grid, trips)?;
    let graph = Graph::new(grid, obstacles);
    let starts: Vec<u32> = trips.iter().map(|trip| graph.number(trip.from)).collect();
    let goals: Vec<u32> = trips.iter().map(|trip| graph.number(trip.to)).collect();
    if graph.paths() * trips.len() > DISTANCES_MAX {
        return Err(NoWays::TooLarge { paths: graph.paths(), robots: trips.len() });
    }
    let distances: Vec<Vec<u32>> = goals.iter().map(|goal| graph.distances_to(*goal)).collect();
    let parted = (0..trips.len()).find(|robot| distances[*robot][starts[*robot] as usize] == NONE);
    if let Some(robot) = parted {
        return Err(NoWays::Parted { from: trips[robot].from, to: trips[robot].to });
    }
    let moments = match Search::new(&graph, &distances, &starts, &goals).run(looks_max) {
        Found::Solution { moments, is_least } => refined(&graph, &distances, &goals, moments, is_least),
        Found::Nothing => return Err(NoWays::Impossible),
        Found::TooLong => return Err(NoWays::GivenUp { looks: looks_max }),
    };
    let cells = |paths: Vec<u32>| paths.into_iter().map(|path| graph.cell(path)).collect();
    Ok(Ways { moments: moments.into_iter().map(cells).collect() })
}

fn check(grid: &Grid, trips: &[Trip]) -> Result<(), NoWays> {
    for end in [|trip: &Trip| trip.from, |trip: &Trip| trip.to] {
        let mut seen = BTreeSet::new();
        for cell in trips.iter().map(end) {
            if grid.square(cell) != Some(Square::Path) {
                return Err(NoWays::NotAPath { cell });
            }
            if !seen.insert(cell) {
                return Err(NoWays::Shared { cell });
            }
        }
    }
    Ok(())
}

fn refined(
    graph: &Graph,
    distances: &[Vec<u32>],
    goals: &[u32],
    moments: Vec<Vec<u32>>,
    is_least: bool,
) -> Vec<Vec<u32>> {
    if is_least || moments.len() * graph.paths() > TABLE_MAX {
        return moments;
    }
    let mut table = Timetable::new(graph, distances, goals, &moments);
    refining::refine(&mut table, TRIES * goals.len() as u32);
    let last = (0..goals.len()).map(|robot| table.arrival(robot)).max().unwrap_or(0);
    (0..=last as usize).map(|moment| table.ways().iter().map(|way| way[moment]).collect()).collect()
}
