//! Errors of drawing.

/// Most tiles that the map of one module may have.
pub const TILES_MAX: usize = 4096;

/// Why a value was not drawn. The scene continues without it.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// A map says that it has other cells than it brings.
    #[error("map of {module}: {columns} x {rows} cells announced, {cells} there; its sender is at fault")]
    Shape {
        /// The sending module.
        module: String,
        /// Cells in a row, as announced.
        columns: u32,
        /// Rows, as announced.
        rows: u32,
        /// Cells that came.
        cells: usize,
    },
    /// A map's place or its cells' size are not finite, or its cells have no size.
    #[error("map of {0}: its origin or its resolution is not a usable number; its sender is at fault")]
    Place(String),
    /// A map came in more tiles than a scene keeps.
    #[error("map of {0}: more than {max} tiles; send larger ones", max = TILES_MAX)]
    Tiles(String),
    /// What came is not what its description says.
    #[error("{data} of {module} cannot be read: {cause}; its sender is at fault")]
    Unreadable {
        /// The sending module.
        module: String,
        /// Which of its data.
        data: String,
        /// What is wrong with it.
        cause: String,
    },
}
