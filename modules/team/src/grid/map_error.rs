//! Mistakes of a map's text.

use super::squares::CELLS_MAX;
use thiserror::Error;

/// Characters of a line that a message repeats.
const FOUND_CHARS: usize = 40;

/// Why a text is no map. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MapError {
    /// The first line begins no format.
    #[error(
        "line 1, column 1: expected `rohrpost-map 1`, `type octile`, or the first row of a drawn map (`*` wall, `.` \
         path, blank); found `{found}`"
    )]
    UnknownFormat {
        /// The first line, or its beginning.
        found: String,
    },
    /// A header line that is not `key value` with a key of the format.
    #[error("line {line}, column 1: expected {expected}; found `{found}`")]
    Header {
        /// Where.
        line: usize,
        /// What may stand there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// The text ends before the rows, in their middle, or a header line is missing.
    #[error("line {line}, column {column}: the map ends here; expected {missing}")]
    Ended {
        /// The last line.
        line: usize,
        /// Behind its last character.
        column: usize,
        /// What should have come.
        missing: String,
    },
    /// A character that is no square of the format.
    #[error("line {line}, column {column}: `{}` is no square; expected {expected}", found.escape_debug())]
    Square {
        /// Where.
        line: usize,
        /// Where in the line.
        column: usize,
        /// What stands there.
        found: char,
        /// What may stand there.
        expected: &'static str,
    },
    /// A row longer or shorter than the header says, or than the first one.
    #[error("line {line}, column {}: the row has {found} squares; expected {expected}", found.min(expected) + 1)]
    RowLength {
        /// Where.
        line: usize,
        /// Squares in it.
        found: usize,
        /// Squares that it should have.
        expected: usize,
    },
    /// More rows than the header says.
    #[error("line {line}, column 1: a row too many; expected {expected} rows, as `height` says")]
    MoreRows {
        /// The first line too many.
        line: usize,
        /// Rows that the header announces.
        expected: usize,
    },
    /// More squares than [`CELLS_MAX`].
    #[error("line {line}, column 1: {columns} x {rows} squares are too many; expected at most {CELLS_MAX}")]
    TooLarge {
        /// The first row, or the header line that announces them.
        line: usize,
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
    },
}

impl MapError {
    /// The line of the mistake.
    pub fn line(&self) -> usize {
        match self {
            Self::UnknownFormat { .. } => 1,
            Self::Header { line, .. }
            | Self::Ended { line, .. }
            | Self::Square { line, .. }
            | Self::RowLength { line, .. }
            | Self::MoreRows { line, .. }
            | Self::TooLarge { line, .. } => *line,
        }
    }
}

/// What a message repeats of a text.
pub(super) fn quoted(text: &str) -> String {
    text.chars().take(FOUND_CHARS).collect()
}
