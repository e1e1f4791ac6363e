//! A robot's world from a text map: squares that are free or blocked, and where the robot starts.
//!
//! The text is a `rohrpost-map` with one robot, or a grid map of the MovingAI benchmarks; `rohrpost_team::grid` reads
//! both. The file is drawn as the world lies: x grows to the right, y upwards; (0, 0) is the outer corner of the lower
//! left square. All beyond the map is blocked.

use rohrpost_modules::types::Pose;
use rohrpost_team::grid::{Cell, Direction, Format, Map, MapError, Square};
use thiserror::Error;

/// Why a text is no world. Lines count from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WorldError {
    /// The text is no map.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A map of another format.
    #[error("line 1: expected `{0}`")]
    NotThisFormat(&'static str),
    /// Two start marks.
    #[error("line {line}, column {column}: the robot starts a second time; expected one of > ^ < or v")]
    SecondStart {
        /// Where.
        line: usize,
        /// Where in the line, from 1.
        column: usize,
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
    ///
    /// # Errors
    /// The first mistake of the map, or that it does not say where one robot starts.
    pub fn parse(text: &str) -> Result<Self, WorldError> {
        let map = Map::read(text.as_bytes())?;
        let cell_m = map.cell_m.ok_or(WorldError::NotThisFormat("rohrpost-map 1"))?;
        match map.robots[..] {
            [] => Err(WorldError::NoStart),
            [(cell, facing)] => Ok(Self::new(&map, cell_m, cell, facing)),
            [_, (second, _), ..] => {
                let (line, column) = map.line_and_column(second);
                Err(WorldError::SecondStart { line, column })
            }
        }
    }

    /// Reads the grid format of the MovingAI benchmarks. The robot starts in the free square nearest to the middle,
    /// facing along x.
    ///
    /// # Errors
    /// The first mistake of the map, that no square is free, or that `cell_m` is no size.
    pub fn parse_octile(text: &str, cell_m: f64) -> Result<Self, WorldError> {
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(WorldError::CellSize(cell_m));
        }
        let map = Map::read(text.as_bytes())?;
        if map.format != Format::MovingAi {
            return Err(WorldError::NotThisFormat("type octile"));
        }
        let off_middle = |cell: &Cell| {
            let off = |place: u32, size: u32| u64::from((2 * place + 1).abs_diff(size)).pow(2);
            // Of several as near, the lowest on the left.
            (off(cell.column, map.grid.columns()) + off(cell.row, map.grid.rows()), std::cmp::Reverse(cell.row))
        };
        let free = map.grid.cells().filter(|(_, square)| *square == Square::Path);
        let start = free.map(|(cell, _)| cell).min_by_key(off_middle).ok_or(WorldError::NoStart)?;
        Ok(Self::new(&map, cell_m, start, None))
    }

    /// A world in which only walls are blocked: blanks of a drawn map are free, though nobody is meant to drive there.
    ///
    /// # Errors
    /// `cell_m` is no size.
    pub fn with_walls(map: &Map, cell_m: f64, start: Cell, facing: Option<Direction>) -> Result<Self, WorldError> {
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(WorldError::CellSize(cell_m));
        }
        let mut world = Self::new(map, cell_m, start, facing);
        let squares = map.grid.rows_of_squares().rev().flatten();
        world.blocked = squares.map(|square| *square == Square::Wall).collect();
        Ok(world)
    }

    fn new(map: &Map, cell_m: f64, start: Cell, facing: Option<Direction>) -> Self {
        let (columns, rows) = (map.grid.columns() as usize, map.grid.rows() as usize);
        // A map begins in the north, y in the south.
        let blocked = map.grid.rows_of_squares().rev().flatten().map(|square| *square != Square::Path).collect();
        let middle_of = |cell: usize| (cell as f64 + 0.5) * cell_m;
        let start = Pose {
            x_m: middle_of(start.column as usize),
            y_m: middle_of(rows - 1 - start.row as usize),
            heading_rad: facing.map_or(0.0, Direction::heading_rad),
        };
        Self { cell_m, columns, rows, blocked, start }
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
        let is_finite = x_m.is_finite() && y_m.is_finite() && radius_m.is_finite();
        !is_finite || self.contact(x_m, y_m, radius_m).is_some()
    }

    /// Where a disc reaches into a blocked square: the point of it that is nearest to the disc's centre, metres. `None`
    /// if it reaches into none.
    pub fn contact(&self, x_m: f64, y_m: f64, radius_m: f64) -> Option<(f64, f64)> {
        let (x, y, radius) = (x_m / self.cell_m, y_m / self.cell_m, radius_m / self.cell_m);
        // Off the map by more than the radius is blocked all over; this also bounds the loops below.
        if self.is_blocked(x.floor() as i64, y.floor() as i64) {
            return Some((x_m, y_m));
        }
        let columns = (x - radius).floor().max(-1.0) as i64..=(x + radius).floor().min(self.columns as f64) as i64;
        let rows = (y - radius).floor().max(-1.0) as i64..=(y + radius).floor().min(self.rows as f64) as i64;
        let squares = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
        let reached = squares.filter_map(|(column, row)| {
            let (near_x, near_y) = (nearest(x, column), nearest(y, row));
            let distance_squared = (x - near_x).powi(2) + (y - near_y).powi(2);
            let is_reached = distance_squared < radius * radius && self.is_blocked(column, row);
            is_reached.then_some((distance_squared, (near_x * self.cell_m, near_y * self.cell_m)))
        });
        reached.min_by(|(one, _), (other, _)| one.total_cmp(other)).map(|(_, point)| point)
    }

    /// Whether all of a disc is in blocked squares. What is off the map is not known to be blocked.
    pub fn disc_is_blocked(&self, x_m: f64, y_m: f64, radius_m: f64) -> bool {
        let (columns, rows) = (self.span(x_m, radius_m, self.columns), self.span(y_m, radius_m, self.rows));
        let (Some(columns), Some(rows)) = (columns, rows) else { return false };
        let (x, y, radius) = (x_m / self.cell_m, y_m / self.cell_m, radius_m / self.cell_m);
        rows.into_iter().all(|row| {
            columns.clone().all(|column| {
                let (near_x, near_y) = (nearest(x, column), nearest(y, row));
                self.is_blocked(column, row) || (x - near_x).hypot(y - near_y) > radius
            })
        })
    }

    /// Squares along one axis, of so many, that a disc reaches into; none if it reaches off the map.
    fn span(&self, middle_m: f64, radius_m: f64, squares: usize) -> Option<std::ops::RangeInclusive<i64>> {
        let (first, last) = ((middle_m - radius_m) / self.cell_m, (middle_m + radius_m) / self.cell_m);
        (first >= 0.0 && last < squares as f64).then_some(first as i64..=last as i64)
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

#[cfg(test)]
#[path = "world_tests.rs"]
mod tests;
