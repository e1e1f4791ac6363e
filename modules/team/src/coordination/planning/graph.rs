//! The paths of a grid, numbered in the order of the file, and the steps between them.

use crate::grid::{Cell, Direction, Grid, Obstacle, ObstacleKind};
use std::collections::VecDeque;

/// No path, no robot, no distance.
pub(super) const NONE: u32 = u32::MAX;
const ALL_STEPS: u8 = 0b1111;

/// Paths, and which steps lead into each of them: all, or those that obstacles let pass (table 3.1 of the seed).
pub(super) struct Graph {
    columns: u32,
    /// By cell of the grid.
    numbers: Vec<u32>,
    cells: Vec<Cell>,
    /// By path, then by direction.
    beside: Vec<[u32; 4]>,
    /// By path: a bit for each direction of a step that may enter it.
    entered_by: Vec<u8>,
}

impl Graph {
    pub(super) fn new(grid: &Grid, obstacles: &[Obstacle]) -> Self {
        let mut numbers = vec![NONE; grid.columns() as usize * grid.rows() as usize];
        let cells: Vec<Cell> = grid.cells().map(|(cell, _)| cell).filter(|cell| grid.is_path(*cell)).collect();
        let columns = grid.columns();
        for (number, cell) in (0..).zip(&cells) {
            numbers[cell.row as usize * columns as usize + cell.column as usize] = number;
        }
        let entered_by = vec![ALL_STEPS; cells.len()];
        let mut graph = Self { columns, numbers, cells, beside: Vec::new(), entered_by };
        let beside = |cell: &Cell| Direction::ALL.map(|step| cell.next(step).map_or(NONE, |next| graph.number(next)));
        graph.beside = graph.cells.iter().map(beside).collect();
        for Obstacle { cell, kind } in obstacles {
            let passing = match kind {
                ObstacleKind::Moving(step) => 1 << *step as u8,
                ObstacleKind::Intruder | ObstacleKind::Stopped => 0,
            };
            let number = graph.number(*cell);
            graph.entered_by.get_mut(number as usize).into_iter().for_each(|steps| *steps &= passing);
        }
        graph
    }

    pub(super) fn paths(&self) -> usize {
        self.cells.len()
    }

    /// [`NONE`] for what is no path.
    pub(super) fn number(&self, cell: Cell) -> u32 {
        let at = cell.row as usize * self.columns as usize + cell.column as usize;
        self.numbers.get(at).copied().filter(|_| cell.column < self.columns).unwrap_or(NONE)
    }

    pub(super) fn cell(&self, path: u32) -> Cell {
        self.cells[path as usize]
    }

    /// Paths that a step leads to, in the order of [`Direction::ALL`].
    pub(super) fn next(&self, path: u32) -> impl Iterator<Item = u32> {
        let beside = self.beside[path as usize].into_iter().enumerate();
        beside.filter(|(step, to)| *to != NONE && self.lets_in(*to, *step)).map(|(_, to)| to)
    }

    /// Steps from each path to a goal, alone; [`NONE`] where there is no way.
    pub(super) fn distances_to(&self, goal: u32) -> Vec<u32> {
        let mut distances = vec![NONE; self.paths()];
        distances[goal as usize] = 0;
        let mut queue = VecDeque::from([goal]);
        while let Some(to) = queue.pop_front() {
            let distance = distances[to as usize] + 1;
            for step in Direction::ALL.into_iter().filter(|step| self.lets_in(to, *step as usize)) {
                let from = self.beside[to as usize][step.reversed() as usize];
                if from != NONE && distances[from as usize] == NONE {
                    distances[from as usize] = distance;
                    queue.push_back(from);
                }
            }
        }
        distances
    }

    fn lets_in(&self, path: u32, step: usize) -> bool {
        self.entered_by[path as usize] >> step & 1 == 1
    }
}
