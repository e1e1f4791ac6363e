//! What the commands of a team plan on: a map, and what is in the way.

use crate::terminal::{Failure, complain};
use rohrpost_team::grid::{CELLS_MAX, Cell, Grid, Map, Obstacle, TooClose};
use serde_json::{Value, json};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest file that is read, bytes: the largest map, with as many ends of lines and remarks.
const FILE_BYTES_MAX: usize = 4 * CELLS_MAX;
/// Paths too close to walls that are told one by one.
const TOLD_MAX: usize = 10;

#[derive(clap::Args)]
pub(crate) struct GroundArguments {
    /// The map, as drawn (`*` wall, `.` path), MovingAI's, or a `rohrpost-map`.
    map: PathBuf,
    /// Robots and intruders in the way, a line each: `3,4 N` moves north; `3,4 stopped`; `3,4 intruder`.
    #[arg(long, value_name = "FILE")]
    robots: Option<PathBuf>,
    /// Refuse a drawn map with paths beside walls or bounds, instead of a warning.
    #[arg(long)]
    strict: bool,
}

/// A grid, and what is on it.
pub(crate) struct Ground {
    pub(crate) grid: Grid,
    pub(crate) obstacles: Vec<Obstacle>,
}

impl GroundArguments {
    /// Reads both files; warns of what may be a mistake.
    pub(crate) fn read(&self) -> Result<Ground, Failure> {
        let map = Map::read(&bytes(&self.map)?).map_err(|error| at(&self.map, &error))?;
        let close = told(&self.map, map.too_close());
        match close {
            Some(text) if self.strict => return Err(text.into()),
            Some(text) => complain(format_args!("warning: {text}")),
            None => {}
        }
        let obstacles = match &self.robots {
            Some(file) => Obstacle::read(&bytes(file)?, &map.grid).map_err(|error| at(file, &error))?,
            None => Vec::new(),
        };
        if self.robots.is_none() && !(map.robots.is_empty() && map.intruders.is_empty()) {
            complain("note: robots and intruders that a map draws begin there; --robots says what is in the way");
        }
        Ok(Ground { grid: map.grid, obstacles })
    }
}

/// The first of these warnings, and how many more there are.
fn told(file: &Path, close: impl Iterator<Item = TooClose>) -> Option<String> {
    let mut close = close.peekable();
    close.peek()?;
    let mut lines: Vec<String> = close.by_ref().take(TOLD_MAX).map(|close| at(file, &close)).collect();
    let more = close.count();
    if more > 0 {
        lines.push(format!("{}: {more} more such paths", file.display()));
    }
    Some(lines.join("\n"))
}

fn at(file: &Path, what: &impl std::fmt::Display) -> String {
    format!("{}: {what}", file.display())
}

/// A file that may be anything: a pipe that never ends, say.
fn bytes(file: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let read = File::open(file).and_then(|opened| opened.take(FILE_BYTES_MAX as u64 + 1).read_to_end(&mut bytes));
    read.map_err(|error| at(file, &error))?;
    if bytes.len() > FILE_BYTES_MAX {
        return Err(
            at(file, &format_args!("longer than {FILE_BYTES_MAX} bytes; expected a map or a list of robots")).into()
        );
    }
    Ok(bytes)
}

/// A cell for programs: column and row.
pub(crate) fn cell_json(cell: Cell) -> Value {
    json!([cell.column, cell.row])
}
