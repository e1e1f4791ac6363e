//! A robot's world from a text map: squares that are free or blocked, and where the robot starts.
//!
//! Our own format: a header, the line `map`, then rows from north to south. The file is drawn as the world lies: x
//! grows to the right, y upwards; (0, 0) is the outer corner of the lower left square. All beyond the map is blocked.
//!
//! ```text
//! rohrpost-map 1
//! # a remark
//! cell_m 0.2
//! map
//! #######      # blocked
//! #  >  #      space or . free      > ^ < v free, and the robot starts here, facing so
//! #######
//! ```
//!
//! The other one is the grid format of the MovingAI benchmarks (`type octile`).

use rohrpost_modules::types::Pose;
use std::f64::consts::{FRAC_PI_2, PI};
use thiserror::Error;

/// Squares in a map; enough for 400 m × 400 m at 0.2 m.
pub const CELLS_MAX: usize = 4_000_000;

/// Why a text is no map. Lines count from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MapError {
    /// The first line does not name the format.
    #[error("line 1: expected `{0}`")]
    NotThisFormat(&'static str),
    /// A header line that is not `key value` with a key of the format.
    #[error("line {line}: expected {expected}, found `{found}`")]
    Header {
        /// Where.
        line: usize,
        /// What may stand there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// The text ends before the rows, or a header line is missing.
    #[error("line {line}: the map ends here without {missing}")]
    Ended {
        /// The last line.
        line: usize,
        /// What should have come.
        missing: &'static str,
    },
    /// A character that means nothing.
    #[error("line {line}, column {column}: `{found}` is no square of a map")]
    Square {
        /// Where.
        line: usize,
        /// Where in the line, from 1.
        column: usize,
        /// What stands there.
        found: char,
    },
    /// A row longer or shorter than the first (or than the header says).
    #[error("line {line}: the row has {found} squares instead of {expected}")]
    RowLength {
        /// Where.
        line: usize,
        /// Squares in it.
        found: usize,
        /// Squares in the others.
        expected: usize,
    },
    /// More rows than the header says, or more squares than [`CELLS_MAX`].
    #[error("line {line}: the map is too large")]
    TooLarge {
        /// Where.
        line: usize,
    },
    /// Two start marks.
    #[error("line {line}: the robot starts a second time")]
    SecondStart {
        /// Where.
        line: usize,
    },
    /// No start mark; or no free square at all.
    #[error("nowhere to start: mark one free square with > ^ < or v")]
    NoStart,
    /// The size of a square that the caller gave is not a positive number.
    #[error("a square of {0} m")]
    CellSize(f64),
}

/// Squares, free or blocked.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// Row 0 is the lowest (y = 0).
    blocked: Vec<bool>,
    start: Pose,
}

impl World {
    /// Reads our own format.
    ///
    /// ```
    /// use rohrpost_robot::world::World;
    /// let world = World::parse("rohrpost-map 1\ncell_m 0.5\nmap\n#####\n#> .#\n#####\n").unwrap();
    /// assert_eq!((world.start().x_m, world.start().y_m), (0.75, 0.75));
    /// assert_eq!(world.cast(0.75, 0.75, 0.0, 10.0), Some(1.25));
    /// assert!(World::parse("rohrpost-map 1\ncell_m 0.5\nmap\n#?#\n").is_err());
    /// ```
    pub fn parse(text: &str) -> Result<Self, MapError> {
        let mut lines = numbered(text);
        if lines.next().is_none_or(|(_, line)| line != "rohrpost-map 1") {
            return Err(MapError::NotThisFormat("rohrpost-map 1"));
        }
        let mut cell_m = None;
        let mut last = 1;
        loop {
            let Some((number, line)) = lines.next() else {
                return Err(MapError::Ended { line: last, missing: "the line `map`" });
            };
            last = number;
            match line.split_once(' ') {
                _ if line == "map" => break,
                _ if line.is_empty() || line.starts_with('#') => {}
                Some(("cell_m", value)) => cell_m = Some(positive(number, value)?),
                _ => return Err(header(number, "`cell_m` and metres, or `map`", line)),
            }
        }
        let cell_m = cell_m.ok_or(MapError::Ended { line: last, missing: "the line `cell_m` and metres" })?;
        let drawn = Drawn::read(last, lines, None, square)?;
        let start = drawn.start.ok_or(MapError::NoStart)?;
        Ok(drawn.world(cell_m, start))
    }

    /// Reads the grid format of the MovingAI benchmarks. The robot starts in the free square nearest to the middle,
    /// facing along x.
    pub fn parse_octile(text: &str, cell_m: f64) -> Result<Self, MapError> {
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(MapError::CellSize(cell_m));
        }
        let mut lines = numbered(text);
        if lines.next().is_none_or(|(_, line)| line != "type octile") {
            return Err(MapError::NotThisFormat("type octile"));
        }
        let rows = dimension(&mut lines, "height")?;
        let columns = dimension(&mut lines, "width")?;
        let last = match lines.next() {
            Some((number, "map")) => number,
            Some((number, line)) => return Err(header(number, "`map`", line)),
            None => return Err(MapError::Ended { line: 3, missing: "the line `map`" }),
        };
        let drawn = Drawn::read(last, lines, Some((columns, rows)), octile_square)?;
        let start = drawn.middle().ok_or(MapError::NoStart)?;
        Ok(drawn.world(cell_m, start))
    }

    /// Where the robot starts.
    pub fn start(&self) -> Pose {
        self.start
    }

    /// Side of a square, metres.
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Extent along x and y, metres.
    pub fn size_m(&self) -> (f64, f64) {
        (self.columns as f64 * self.cell_m, self.rows as f64 * self.cell_m)
    }

    /// Whether this place is inside a blocked square or off the map.
    pub fn is_blocked_at(&self, x_m: f64, y_m: f64) -> bool {
        // A cast of something not finite saturates or is 0: ask before.
        !(x_m.is_finite() && y_m.is_finite())
            || self.is_blocked((x_m / self.cell_m).floor() as i64, (y_m / self.cell_m).floor() as i64)
    }

    /// Whether a disc reaches into a blocked square. Touching from outside is no collision.
    pub fn disc_collides(&self, x_m: f64, y_m: f64, radius_m: f64) -> bool {
        if !(x_m.is_finite() && y_m.is_finite() && radius_m.is_finite()) {
            return true;
        }
        let (x, y, radius) = (x_m / self.cell_m, y_m / self.cell_m, radius_m / self.cell_m);
        // Off the map by more than the radius is blocked all over; this also bounds the loops below.
        if self.is_blocked(x.floor() as i64, y.floor() as i64) {
            return true;
        }
        let columns = (x - radius).floor().max(-1.0) as i64..=(x + radius).floor().min(self.columns as f64) as i64;
        let rows = (y - radius).floor().max(-1.0) as i64..=(y + radius).floor().min(self.rows as f64) as i64;
        rows.into_iter().any(|row| {
            columns.clone().any(|column| {
                let (near_x, near_y) = (nearest(x, column), nearest(y, row));
                let distance_squared = (x - near_x).powi(2) + (y - near_y).powi(2);
                distance_squared < radius * radius && self.is_blocked(column, row)
            })
        })
    }

    /// Whether a square is blocked, or off the map.
    pub(super) fn is_blocked(&self, column: i64, row: i64) -> bool {
        match (usize::try_from(column), usize::try_from(row)) {
            (Ok(column), Ok(row)) if column < self.columns && row < self.rows => {
                self.blocked[row * self.columns + column]
            }
            _ => true,
        }
    }
}

/// The place of a cell that is nearest to `place`, along one axis.
fn nearest(place: f64, cell: i64) -> f64 {
    place.clamp(cell as f64, cell as f64 + 1.0)
}

/// Column, row and heading.
type Start = (usize, usize, f64);

/// A map's rows as drawn, lowest first.
struct Drawn {
    columns: usize,
    rows: usize,
    blocked: Vec<bool>,
    start: Option<Start>,
}

/// What one character means.
enum Square {
    Blocked,
    Free,
    Start(f64),
}

impl Drawn {
    /// `last` is the line before the rows.
    fn read<'t>(
        mut last: usize,
        lines: impl Iterator<Item = (usize, &'t str)>,
        size: Option<(usize, usize)>,
        meaning: fn(char) -> Option<Square>,
    ) -> Result<Self, MapError> {
        let mut drawn = Self { columns: size.map_or(0, |size| size.0), rows: 0, blocked: Vec::new(), start: None };
        for (line, text) in lines {
            last = line;
            // Only an end of the file: a row of walls has no empty line in it, and a free one has its spaces.
            if text.is_empty() {
                continue;
            }
            drawn.add_row(line, text, meaning)?;
            if size.is_some_and(|(_, rows)| drawn.rows > rows) {
                return Err(MapError::TooLarge { line });
            }
        }
        if drawn.rows == 0 || size.is_some_and(|(_, rows)| drawn.rows < rows) {
            return Err(MapError::Ended { line: last, missing: "all of its rows" });
        }
        Ok(drawn.turned())
    }

    fn add_row(&mut self, line: usize, text: &str, meaning: fn(char) -> Option<Square>) -> Result<(), MapError> {
        let found = text.chars().count();
        if self.columns == 0 {
            self.columns = found;
        }
        if found != self.columns {
            return Err(MapError::RowLength { line, found, expected: self.columns });
        }
        if self.blocked.len() + found > CELLS_MAX {
            return Err(MapError::TooLarge { line });
        }
        for (column, found) in text.chars().enumerate() {
            let square = meaning(found).ok_or(MapError::Square { line, column: column + 1, found })?;
            self.blocked.push(matches!(square, Square::Blocked));
            if let Square::Start(heading_rad) = square
                && self.start.replace((column, self.rows, heading_rad)).is_some()
            {
                return Err(MapError::SecondStart { line });
            }
        }
        self.rows += 1;
        Ok(())
    }

    /// The file begins in the north, y in the south.
    fn turned(self) -> Self {
        let blocked = self.blocked.chunks(self.columns).rev().flatten().copied().collect();
        let start = self.start.map(|(column, row, heading_rad)| (column, self.rows - 1 - row, heading_rad));
        Self { blocked, start, ..self }
    }

    /// The free square nearest to the middle, facing along x.
    fn middle(&self) -> Option<Start> {
        let squares = (0..self.blocked.len()).map(|index| (index % self.columns, index / self.columns));
        let free = squares.zip(&self.blocked).filter_map(|(place, blocked)| (!blocked).then_some(place));
        let off_middle = |(column, row): &(usize, usize)| {
            (2 * column + 1).abs_diff(self.columns).pow(2) + (2 * row + 1).abs_diff(self.rows).pow(2)
        };
        free.min_by_key(off_middle).map(|(column, row)| (column, row, 0.0))
    }

    fn world(self, cell_m: f64, (column, row, heading_rad): Start) -> World {
        let Self { columns, rows, blocked, .. } = self;
        let middle_of = |cell: usize| (cell as f64 + 0.5) * cell_m;
        let start = Pose { x_m: middle_of(column), y_m: middle_of(row), heading_rad };
        World { cell_m, columns, rows, blocked, start }
    }
}

fn square(character: char) -> Option<Square> {
    Some(match character {
        '#' => Square::Blocked,
        ' ' | '.' => Square::Free,
        '>' => Square::Start(0.0),
        '^' => Square::Start(FRAC_PI_2),
        '<' => Square::Start(PI),
        'v' => Square::Start(-FRAC_PI_2),
        _ => return None,
    })
}

/// Swamp, water and other ground of the benchmarks is not in the maps we use, and says nothing to a wheel.
fn octile_square(character: char) -> Option<Square> {
    match character {
        '@' | 'O' | 'T' => Some(Square::Blocked),
        '.' | 'G' => Some(Square::Free),
        _ => None,
    }
}

/// Lines from 1, without a carriage return at their end.
fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(index, line)| (index + 1, line))
}

fn header(line: usize, expected: &'static str, found: &str) -> MapError {
    MapError::Header { line, expected, found: found.chars().take(40).collect() }
}

fn positive(line: usize, text: &str) -> Result<f64, MapError> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| header(line, "a positive number of metres", text))
}

fn dimension<'t>(lines: &mut impl Iterator<Item = (usize, &'t str)>, key: &'static str) -> Result<usize, MapError> {
    let (number, line) = lines.next().ok_or(MapError::Ended { line: 1, missing: key })?;
    let value = line.strip_prefix(key).and_then(|rest| rest.trim().parse().ok()).filter(|value| *value > 0);
    value.ok_or_else(|| header(number, key, line))
}

#[cfg(test)]
#[path = "world_tests.rs"]
mod tests;
