//! The squares of a grid, row by row in one array.

use super::cell::Cell;

/// Cells in a grid; enough for 400 m × 400 m at 0.2 m.
pub const CELLS_MAX: usize = 4_000_000;

/// What one cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Square {
    /// A robot may drive there.
    Path,
    /// Blocked.
    Wall,
    /// Neither: free, but no robot drives there.
    Blank,
}

impl Square {
    /// For messages.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Path => "a path",
            Self::Wall => "a wall",
            Self::Blank => "a blank",
        }
    }
}

/// Squares of a map without marks, names or sizes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    columns: u32,
    /// The first row is the uppermost.
    squares: Vec<Square>,
}

impl Grid {
    /// Rows of `columns` squares each, the uppermost first; `None` if they are none, no whole rows, or more than
    /// [`CELLS_MAX`].
    pub fn new(columns: u32, squares: Vec<Square>) -> Option<Self> {
        let whole = !squares.is_empty() && columns > 0 && squares.len().is_multiple_of(columns as usize);
        (whole && squares.len() <= CELLS_MAX).then_some(Self { columns, squares })
    }

    /// Columns.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows.
    pub fn rows(&self) -> u32 {
        (self.squares.len() / self.columns as usize) as u32
    }

    /// What a cell is; `None` outside of the grid.
    pub fn square(&self, cell: Cell) -> Option<Square> {
        let at = cell.row as usize * self.columns as usize + cell.column as usize;
        self.squares.get(at).copied().filter(|_| cell.column < self.columns)
    }

    /// Whether a robot may drive there.
    pub fn is_path(&self, cell: Cell) -> bool {
        self.square(cell) == Some(Square::Path)
    }

    /// The squares of all rows, the uppermost first.
    pub fn rows_of_squares(&self) -> impl DoubleEndedIterator<Item = &[Square]> {
        self.squares.chunks(self.columns as usize)
    }

    /// All cells, row by row.
    pub fn cells(&self) -> impl Iterator<Item = (Cell, Square)> {
        self.rows_of_squares().zip(0..).flat_map(|(squares, row)| {
            squares.iter().zip(0..).map(move |(square, column)| (Cell { column, row }, *square))
        })
    }
}
