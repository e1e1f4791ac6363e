//! Intruders as robots block them, and their sides.

use crate::grid::Cell;
use crate::view::ObjectId;
use std::fmt;

/// An intruder, as the agreed view has it.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Target {
    /// Name of the intruder in the view.
    pub id: ObjectId,
    /// Cells that it stands in, at least one.
    pub cells: Vec<Cell>,
}

/// A side of an intruder: what a robot that holds an exit announces.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Post {
    /// Which intruder.
    pub intruder: ObjectId,
    /// Columns from the intruder's first cell in the order of the file to the exit.
    pub right: i32,
    /// Rows from there to the exit.
    pub down: i32,
}

impl Post {
    pub(super) fn beside(intruder: &Target, exit: Cell) -> Self {
        let first = intruder.cells.iter().min_by_key(|cell| (cell.row, cell.column)).copied().unwrap_or(exit);
        let (right, down) = (exit.column.wrapping_sub(first.column), exit.row.wrapping_sub(first.row));
        Self { intruder: intruder.id, right: right as i32, down: down as i32 }
    }
}

/// Why nobody holds an exit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WhyOpen {
    /// No robot can get there.
    #[error("no robot can reach it")]
    OutOfReach,
    /// A robot that takes no part, or cannot move, stands there.
    #[error("a robot that stands is in it")]
    Barred,
    /// Robots are too few.
    #[error("robots are too few, and exits that reach as many paths or more are held")]
    TooFewRobots,
}

/// An exit that nobody holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OpenExit {
    /// The intruder, and the side of it.
    pub post: Post,
    /// The exit.
    pub cell: Cell,
    /// Paths that the intruder can reach through it.
    pub reaches: u32,
    /// The reason.
    pub why: WhyOpen,
}

impl fmt::Display for OpenExit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "exit {} to {} paths is open: {}", self.cell, self.reaches, self.why)
    }
}
