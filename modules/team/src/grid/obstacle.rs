//! What stands in the way of a robot on the paths of a grid, and files that tell it.

use super::cell::{Cell, Direction};
use super::map_error::quoted;
use super::squares::{Grid, Square};
use std::fmt;
use thiserror::Error;

/// The obstacles of the seed's table 3.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObstacleKind {
    /// Stops every wave.
    Intruder,
    /// A robot that stands; stops every wave.
    Stopped,
    /// A robot that moves; a wave passes that moves the same way.
    Moving(Direction),
}

/// A cell with an obstacle in it. A larger one has several cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// Where.
    pub cell: Cell,
    /// What.
    pub kind: ObstacleKind,
}

/// Why a text is no list of obstacles. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ObstacleError {
    /// A line that is none.
    #[error(
        "line {line}, column {column}: expected column,row and N, E, S, W, `stopped` or `intruder`, such as `3,4 N`; \
         found `{found}`"
    )]
    Syntax {
        /// Where.
        line: usize,
        /// The word that is wrong, or where it is missing.
        column: usize,
        /// What stands there.
        found: String,
    },
    /// A cell where no robot can be.
    #[error("line {line}, column {column}: {cell} is {found}; expected a path")]
    NoPath {
        /// Where.
        line: usize,
        /// Where in the line the cell stands.
        column: usize,
        /// The cell.
        cell: Cell,
        /// What the map has there.
        found: &'static str,
    },
}

impl Obstacle {
    /// A robot by its heading, radians counterclockwise from east, and its speed, m/s; below zero it drives backwards.
    /// One without a finite heading or speed counts as stopped: nothing drives into it.
    pub fn robot(cell: Cell, heading_rad: f64, speed_m_s: f64) -> Self {
        let ahead = Direction::of_heading(heading_rad).filter(|_| speed_m_s.is_finite() && speed_m_s != 0.0);
        let step = ahead.map(|ahead| if speed_m_s < 0.0 { ahead.reversed() } else { ahead });
        Self { cell, kind: step.map_or(ObstacleKind::Stopped, ObstacleKind::Moving) }
    }

    /// Reads a list: a line each, with a cell, and N, E, S or W for a robot that moves so, `stopped` for one that
    /// stands, or `intruder`. Empty lines and what follows a `#` do not count.
    ///
    /// ```
    /// # use rohrpost_team::grid::{Map, Obstacle};
    /// let map = Map::read(b"    \n ...\n    ").unwrap();
    /// assert_eq!(Obstacle::read(b"1,1 E # to the door\n3,1 stopped\n", &map.grid).unwrap().len(), 2);
    /// ```
    ///
    /// # Errors
    /// The first line that says something else, or has a cell that is no path.
    pub fn read(text: &[u8], grid: &Grid) -> Result<Vec<Self>, ObstacleError> {
        let text = String::from_utf8_lossy(text);
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default()).zip(1..);
        let said = lines.filter(|(line, _)| !line.trim().is_empty());
        said.map(|(text, line)| Self::read_line(text, line, grid)).collect()
    }

    fn read_line(text: &str, line: usize, grid: &Grid) -> Result<Self, ObstacleError> {
        let mistake = |at: &str| {
            let column = text[..text.len() - at.len()].chars().count() + 1;
            ObstacleError::Syntax { line, column, found: quoted(at.trim_end()) }
        };
        let start = text.trim_start();
        let (first, rest) = start.split_at(start.find(char::is_whitespace).unwrap_or(start.len()));
        let cell: Cell = first.parse().map_err(|_| mistake(start))?;
        let kind = match rest.trim() {
            "N" => ObstacleKind::Moving(Direction::North),
            "E" => ObstacleKind::Moving(Direction::East),
            "S" => ObstacleKind::Moving(Direction::South),
            "W" => ObstacleKind::Moving(Direction::West),
            "stopped" => ObstacleKind::Stopped,
            "intruder" => ObstacleKind::Intruder,
            _ => return Err(mistake(rest.trim_start())),
        };
        if !grid.is_path(cell) {
            let found = grid.square(cell).map_or("outside of the map", Square::words);
            let column = text.len() - start.len() + 1;
            return Err(ObstacleError::NoPath { line, column, cell, found });
        }
        Ok(Self { cell, kind })
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            ObstacleKind::Intruder => write!(f, "an intruder at {}", self.cell),
            ObstacleKind::Stopped => write!(f, "a stopped robot at {}", self.cell),
            ObstacleKind::Moving(step) => write!(f, "a robot at {} that moves {}", self.cell, step.letter()),
        }
    }
}
