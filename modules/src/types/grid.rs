//! Maps of free and occupied squares.

use super::Pose;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// What is known of one square: an occupancy in percent, or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.Cell")]
pub struct Cell(pub u8);

impl Cell {
    /// Never seen.
    pub const UNKNOWN: Self = Self(255);

    /// Occupied with this probability, 0..=100 percent.
    ///
    /// ```
    /// use rohrpost_modules::types::Cell;
    ///
    /// assert_eq!((Cell::percent(40).0, Cell::percent(120).0), (40, 100));
    /// ```
    pub fn percent(percent: u8) -> Self {
        Self(percent.min(100))
    }
}

/// A rectangle of a map. A map larger than a package travels as several of them: each is placed by its own `origin`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.OccupancyGrid")]
pub struct OccupancyGrid {
    /// Where the outer corner of cell (0, 0) lies; columns run along its x, rows along its y.
    pub origin: Pose,
    /// Side of a cell, metres.
    #[schema(unit = "m")]
    pub resolution_m: f32,
    /// Cells in a row.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// Cells, row by row; [`Cell`]s as bytes: 0 free, 100 occupied, 255 never seen.
    pub cells: Vec<u8>,
}
