//! Cells of a grid, and the four steps between them.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::str::FromStr;

/// A cell of a grid, counted from 0 at the upper left of the map as its file is written.
///
/// ```
/// use rohrpost_team::grid::Cell;
/// assert_eq!("3,4".parse(), Ok(Cell { column: 3, row: 4 }));
/// assert!("3;4".parse::<Cell>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Cells to the left of this one.
    pub column: u32,
    /// Cells above this one.
    pub row: u32,
}

impl Cell {
    /// The next cell in a direction; `None` beyond the left or upper bound. A grid says where the others are.
    pub fn next(self, step: Direction) -> Option<Self> {
        let Self { column, row } = self;
        Some(match step {
            Direction::North => Self { column, row: row.checked_sub(1)? },
            Direction::East => Self { column: column.checked_add(1)?, row },
            Direction::South => Self { column, row: row.checked_add(1)? },
            Direction::West => Self { column: column.checked_sub(1)?, row },
        })
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.column, self.row)
    }
}

/// A text that is no cell.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected column,row, counted from 0 at the upper left, such as 3,4")]
pub struct NotACell;

impl FromStr for Cell {
    type Err = NotACell;

    fn from_str(text: &str) -> Result<Self, NotACell> {
        let number = |text: &str| text.trim().parse().map_err(|_| NotACell);
        let (column, row) = text.split_once(',').ok_or(NotACell)?;
        Ok(Self { column: number(column)?, row: number(row)? })
    }
}

/// A step from a cell to the next one. North is up in the file, and along y in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// To the row above.
    North,
    /// To the column on the right.
    East,
    /// To the row below.
    South,
    /// To the column on the left.
    West,
}

impl Direction {
    /// All four, in the order that decides between equal paths.
    pub const ALL: [Self; 4] = [Self::North, Self::East, Self::South, Self::West];

    /// Heading of a robot that moves so, radians counterclockwise from east.
    pub fn heading_rad(self) -> f64 {
        match self {
            Self::North => FRAC_PI_2,
            Self::East => 0.0,
            Self::South => -FRAC_PI_2,
            Self::West => PI,
        }
    }

    /// The direction nearest to a heading, radians counterclockwise from east. Halfway between two, the first one of
    /// [`Self::ALL`]. `None` if the heading is not finite.
    pub fn of_heading(heading_rad: f64) -> Option<Self> {
        // Sums of angles are off by some 1e-16: what differs by less is the same.
        const SAME: f64 = 1e-9;
        let alike = |step: Self| (heading_rad - step.heading_rad()).cos();
        let nearest = |best: Self, step| if alike(step) > alike(best) + SAME { step } else { best };
        Self::ALL.into_iter().reduce(nearest).filter(|_| heading_rad.is_finite())
    }

    /// The opposite direction.
    pub fn reversed(self) -> Self {
        match self {
            Self::North => Self::South,
            Self::East => Self::West,
            Self::South => Self::North,
            Self::West => Self::East,
        }
    }

    /// N, E, S or W.
    pub fn letter(self) -> char {
        match self {
            Self::North => 'N',
            Self::East => 'E',
            Self::South => 'S',
            Self::West => 'W',
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_is_the_nearest_step_and_half_way_the_first_one() {
        use Direction::{East, North, South, West};
        for (degrees, step) in [
            (0.0, East),
            (44.0, East),
            (45.0, North),
            (135.0, North),
            (136.0, West),
            (180.0, West),
            (-180.0, West),
            (-45.0, East),
            (-135.0, South),
            (225.0, South),
            (315.0, East),
            (3600.0 + 80.0, North),
        ] {
            assert_eq!(Direction::of_heading(f64::to_radians(degrees)), Some(step), "{degrees}");
        }
        for heading_rad in [f64::NAN, f64::INFINITY] {
            assert_eq!(Direction::of_heading(heading_rad), None);
        }
    }

    #[test]
    fn steps_lead_there_and_back_and_never_out_of_the_numbers() {
        let cell = Cell { column: 3, row: 4 };
        for step in Direction::ALL {
            assert_eq!(cell.next(step).and_then(|next| next.next(step.reversed())), Some(cell), "{step:?}");
        }
        let (first, last) = (Cell { column: 0, row: 0 }, Cell { column: u32::MAX, row: u32::MAX });
        let stays = |cell: Cell| Direction::ALL.map(|step| cell.next(step).is_none());
        assert_eq!((stays(first), stays(last)), ([true, false, false, true], [false, true, true, false]));
    }

    #[test]
    fn what_is_no_cell_is_refused() {
        for text in ["", "3", "3,", ",4", "3,4,5", "-1,2", "a,b", "1.5,2", "4294967296,0"] {
            assert_eq!(text.parse::<Cell>(), Err(NotACell), "{text}");
        }
        assert_eq!(Cell { column: 3, row: 4 }.to_string(), "3,4");
    }
}
