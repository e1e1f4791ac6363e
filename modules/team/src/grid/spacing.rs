//! What the seed asks of a drawn map beyond its characters: paths keep off walls and bounds, and two maps of one world
//! agree.

use super::cell::Cell;
use super::map::{Format, Map};
use super::squares::{Grid, Square};
use std::fmt;
use thiserror::Error;

/// What a path is too close to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Near {
    /// The path is in the first or last row or column.
    Bound,
    /// A wall in one of the eight cells around; its line and column, from 1.
    Wall(usize, usize),
}

/// A path that is not one character apart from walls and bounds. A robot there may touch them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooClose {
    /// Line of the path, from 1.
    pub line: usize,
    /// The column, from 1.
    pub column: usize,
    /// What it is too close to.
    pub near: Near,
}

impl fmt::Display for TooClose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: a path beside ", self.line, self.column)?;
        match self.near {
            Near::Bound => write!(f, "the bound of the map")?,
            Near::Wall(line, column) => write!(f, "the wall at line {line}, column {column}")?,
        }
        write!(f, "; expected a blank between")
    }
}

/// A cell that two maps of one world draw differently.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}, column {column}: {local} in the local map, {global} in the global one; expected the same")]
pub struct Disagreement {
    /// Line in the local map, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// What the local map has there.
    pub local: &'static str,
    /// What the global map has there.
    pub global: &'static str,
}

impl Map {
    /// Paths that are not one character apart from walls and bounds, in the order of the text. The other formats have
    /// no such rule, and no such paths.
    pub fn too_close(&self) -> impl Iterator<Item = TooClose> {
        let has_rule = self.format == Format::Drawn;
        let paths = self.grid.cells().filter(move |(_, square)| has_rule && *square == Square::Path);
        paths.filter_map(|(cell, _)| {
            let (line, column) = self.line_and_column(cell);
            Some(TooClose { line, column, near: self.near(cell)? })
        })
    }

    fn near(&self, cell: Cell) -> Option<Near> {
        let Cell { column, row } = cell;
        if column == 0 || row == 0 || column + 1 == self.grid.columns() || row + 1 == self.grid.rows() {
            return Some(Near::Bound);
        }
        let around =
            (row - 1..=row + 1).flat_map(|row| (column - 1..=column + 1).map(move |column| Cell { column, row }));
        let wall = around.into_iter().find(|cell| self.grid.square(*cell) == Some(Square::Wall))?;
        let (line, column) = self.line_and_column(wall);
        Some(Near::Wall(line, column))
    }

    /// Checks that walls and paths are where another map of the same world has them: the seed's robots know the local
    /// map, its simulation the global one. Robots and intruders stand on paths; blanks at the end of a row may be left
    /// out.
    ///
    /// # Errors
    /// The first cell that differs.
    pub fn agrees_with(&self, global: &Self) -> Result<(), Disagreement> {
        let word = |grid: &Grid, cell: Cell| match grid.square(cell) {
            Some(square) => square.words(),
            None if cell.row < grid.rows() => Square::Blank.words(),
            None => "no row",
        };
        let columns = self.grid.columns().max(global.grid.columns());
        let rows = self.grid.rows().max(global.grid.rows());
        for cell in (0..rows).flat_map(|row| (0..columns).map(move |column| Cell { column, row })) {
            let (local, global) = (word(&self.grid, cell), word(&global.grid, cell));
            if local != global {
                let (line, column) = self.line_and_column(cell);
                return Err(Disagreement { line, column, local, global });
            }
        }
        Ok(())
    }
}
