//! Maps with walls at random, and trips between paths that are connected: the same for the same seed.

use rohrpost_team::coordination::Trip;
use rohrpost_team::grid::{Cell, Grid, Square, Wave};
use rohrpost_testbed::sim::chance::Chance;

/// A map, and what robots want on it.
pub(crate) struct Crossing {
    pub(crate) grid: Grid,
    pub(crate) trips: Vec<Trip>,
    /// Paths of the largest part that are neither start nor goal, in no order.
    pub(crate) others: Vec<Cell>,
}

impl Crossing {
    /// A square map with so many walls in a hundred cells. `robots` start and end in its largest part, if they fit.
    pub(crate) fn new(seed: u64, side: u32, percent_walls: u64, robots: usize) -> Self {
        let mut chance = Chance::new(seed);
        let square = |_| if chance.percent(percent_walls) { Square::Wall } else { Square::Path };
        let grid = Grid::new(side, (0..side * side).map(square).collect()).unwrap();
        let part = largest_part(&grid);
        let (starts, rest) = shuffled(&part, robots, &mut chance);
        let (goals, _) = shuffled(&part, robots, &mut chance);
        let trips = starts.into_iter().zip(goals.iter()).map(|(from, to)| Trip { from, to: *to }).collect();
        let others = rest.into_iter().filter(|cell| !goals.contains(cell)).collect();
        Self { grid, trips, others }
    }

    /// Steps of all robots if each were alone.
    pub(crate) fn alone(&self) -> u64 {
        let mut wave = Wave::default();
        let way = |trip: &Trip| {
            wave.start(&self.grid, trip.from, [trip.to], []);
            wave.next_goal().and_then(|goal| wave.distance(goal)).unwrap()
        };
        self.trips.iter().map(way).map(u64::from).sum()
    }
}

fn largest_part(grid: &Grid) -> Vec<Cell> {
    let mut wave = Wave::default();
    let mut part = |start: Cell| {
        wave.start(grid, start, [], []);
        wave.next_goal();
        grid.cells().map(|(cell, _)| cell).filter(|cell| wave.distance(*cell).is_some()).collect::<Vec<Cell>>()
    };
    let starts = grid.cells().map(|(cell, _)| cell);
    starts.map(&mut part).max_by_key(Vec::len).unwrap_or_default()
}

/// Some cells in no order, and the others.
fn shuffled(cells: &[Cell], count: usize, chance: &mut Chance) -> (Vec<Cell>, Vec<Cell>) {
    let mut cells = cells.to_vec();
    for at in (1..cells.len()).rev() {
        cells.swap(at, chance.below(at as u64 + 1) as usize);
    }
    let rest = cells.split_off(count.min(cells.len()));
    (cells, rest)
}
