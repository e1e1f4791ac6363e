//! The wavefront (seed 000, 2.4.2 and 3.3): distances from a start to all cells, around obstacles.
//!
//! One array of labels with a bound of cells that nothing enters, and one queue; a cell is labelled once. A label knows
//! the step by which its cell was entered, so a path is followed back along edges that were allowed. Descending by
//! distances alone, as the seed does, may cross an edge that an obstacle forbids.
//!
//! ```text
//!  label   31 … 28            27 26               25     24 … 0
//!          may be entered by  entered by a step   is a   1 + distance, steps;
//!          a step N, E, S, W  N, E, S, W (0 … 3)  goal   0: not reached
//! ```

use super::cell::{Cell, Direction};
use super::obstacle::{Obstacle, ObstacleKind};
use super::squares::{CELLS_MAX, Grid, Square};

const ENTER: u32 = 28;
const STEP: u32 = 26;
const GOAL: u32 = 1 << 25;
const DISTANCE: u32 = GOAL - 1;
/// A path without an obstacle, not reached.
const OPEN: u32 = 0b1111 << ENTER;

const _: () = assert!(CELLS_MAX < DISTANCE as usize, "a distance fits its bits");

/// A wave, and the memory for it: over the same grid again it allocates nothing.
///
/// ```
/// use rohrpost_team::grid::{Cell, Map, Wave};
/// let map = Map::read(b"...\n.*.\n").unwrap();
/// let [start, goal] = [0, 2].map(|column| Cell { column, row: 1 });
/// let mut wave = Wave::default();
/// wave.start(&map.grid, start, [goal], []);
/// assert_eq!((wave.next_goal(), wave.distance(goal)), (Some(goal), Some(4)));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Wave {
    columns: u32,
    rows: u32,
    /// From a cell to the one below: the columns, and a cell of the bound.
    stride: usize,
    labels: Vec<u32>,
    /// Cells in the order in which they were reached, by their place in `labels`.
    queue: Vec<u32>,
    /// Cells of the queue that have spread the wave.
    head: usize,
    /// Cells of the queue.
    tail: usize,
}

impl Wave {
    /// Begins at a cell, which an obstacle there does not hold back. What is outside of the grid has no effect.
    pub fn start(
        &mut self,
        grid: &Grid,
        start: Cell,
        goals: impl IntoIterator<Item = Cell>,
        obstacles: impl IntoIterator<Item = Obstacle>,
    ) {
        self.clear(grid);
        for Obstacle { cell, kind } in obstacles {
            let passing = match kind {
                ObstacleKind::Moving(step) => 1 << (ENTER + step as u32),
                ObstacleKind::Intruder | ObstacleKind::Stopped => 0,
            };
            if let Some(at) = self.index(cell) {
                self.labels[at] &= passing;
            }
        }
        for goal in goals {
            if let Some(at) = self.index(goal).filter(|_| grid.is_path(goal)) {
                self.labels[at] |= GOAL;
            }
        }
        if let Some(at) = self.index(start).filter(|_| grid.is_path(start)) {
            self.labels[at] = self.labels[at] & GOAL | 1;
            self.queue[0] = at as u32;
            self.tail = 1;
        }
    }

    fn clear(&mut self, grid: &Grid) {
        let (columns, rows) = (grid.columns() as usize, grid.rows() as usize);
        (self.columns, self.rows) = (grid.columns(), grid.rows());
        self.stride = columns + 1;
        // Of the bound are a row above, one below, and a cell behind each row.
        self.labels.resize((rows + 2) * self.stride + 1, 0);
        self.queue.resize(columns * rows, 0);
        (self.head, self.tail) = (0, 0);
        let (above, rest) = self.labels.split_at_mut(self.stride);
        above.fill(0);
        let mut labels = rest.chunks_mut(self.stride);
        for (row, labels) in grid.rows_of_squares().zip(&mut labels) {
            for (label, square) in labels.iter_mut().zip(row) {
                *label = if *square == Square::Path { OPEN } else { 0 };
            }
            labels[columns] = 0;
        }
        labels.for_each(|below| below.fill(0));
    }

    /// Spreads until the next goal is reached, the nearest first; `None` when nothing is left that it can enter.
    pub fn next_goal(&mut self) -> Option<Cell> {
        let stride = self.stride;
        while self.head < self.tail {
            let at = self.queue[self.head] as usize;
            self.head += 1;
            let around = &mut self.labels[at - stride..=at + stride];
            let here = around[stride];
            let distance = (here & DISTANCE) + 1;
            // In the order of `Direction`: so the first to reach a cell is the first of all shortest paths to it.
            for (step, beside) in [0, stride + 1, 2 * stride, stride - 1].into_iter().enumerate() {
                let label = around[beside];
                if label >> (ENTER + step as u32) & 1 == 1 {
                    around[beside] = label & GOAL | (step as u32) << STEP | distance;
                    self.queue[self.tail] = (at + beside - stride) as u32;
                    self.tail += 1;
                }
            }
            if here & GOAL != 0 {
                return Some(self.cell(at));
            }
        }
        None
    }

    /// Steps from the start; `None` if the wave has not reached the cell.
    pub fn distance(&self, cell: Cell) -> Option<u32> {
        (self.labels[self.index(cell)?] & DISTANCE).checked_sub(1)
    }

    /// The path back from a cell to the start, both included; empty if the wave has not reached the cell.
    pub fn back_from(&self, cell: Cell) -> impl Iterator<Item = Cell> {
        let mut next = self.index(cell).filter(|at| self.labels[*at] & DISTANCE > 0);
        std::iter::from_fn(move || {
            let at = next?;
            let label = self.labels[at];
            let before = match Direction::ALL[(label >> STEP & 3) as usize] {
                Direction::North => at + self.stride,
                Direction::East => at - 1,
                Direction::South => at - self.stride,
                Direction::West => at + 1,
            };
            next = (label & DISTANCE > 1).then_some(before);
            Some(self.cell(at))
        })
    }

    /// Where the label of a cell is; `None` outside of the grid.
    fn index(&self, cell: Cell) -> Option<usize> {
        let is_inside = cell.column < self.columns && cell.row < self.rows;
        is_inside.then(|| (cell.row as usize + 1) * self.stride + cell.column as usize)
    }

    fn cell(&self, at: usize) -> Cell {
        Cell { column: (at % self.stride) as u32, row: (at / self.stride - 1) as u32 }
    }
}
