//! Errors of drawing.

/// Most tiles that the map of one module may have.
pub const TILES_MAX: usize = 4096;

/// Most bytes of one picture or cloud: one of 3840 by 2160 pixels with opacity. The store has room for it.
pub const LARGE_BYTES_MAX: usize = 32 * 1024 * 1024;

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
    /// A picture or a cloud says that it has other bytes than it brings.
    #[error("{data} of {module}: {why}; its sender is at fault")]
    Sizes {
        /// The sending module.
        module: String,
        /// Which of its data.
        data: String,
        /// What does not fit together.
        why: String,
    },
    /// A picture or a cloud is larger than [`LARGE_BYTES_MAX`].
    #[error(
        "{data} of {module} has {bytes} bytes, and no more than {max} are drawn of one thing; send it smaller, or as \
         JPEG",
        max = LARGE_BYTES_MAX
    )]
    Large {
        /// The sending module.
        module: String,
        /// Which of its data.
        data: String,
        /// Its bytes.
        bytes: usize,
    },
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
    /// What came is more than is decoded, and may be right all the same.
    #[error("{data} of {module} is more than is decoded: {cause}")]
    TooMuch {
        /// The sending module.
        module: String,
        /// Which of its data.
        data: String,
        /// What there is too much of.
        cause: String,
    },
}

impl DrawError {
    pub(crate) fn sizes(module: &str, data: &str, why: &dyn std::fmt::Display) -> Self {
        Self::Sizes { module: module.into(), data: data.into(), why: why.to_string() }
    }

    /// Refuses what is larger than [`LARGE_BYTES_MAX`].
    pub(crate) fn unless_larger(module: &str, data: &str, bytes: usize) -> Result<(), Self> {
        match bytes > LARGE_BYTES_MAX {
            true => Err(Self::Large { module: module.into(), data: data.into(), bytes }),
            false => Ok(()),
        }
    }
}
