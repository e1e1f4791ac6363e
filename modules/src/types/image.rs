//! Pictures: what a camera sees, and how far away it is.
//!
//! ```text
//! pixels   ├── row 0 ──┤gap├── row 1 ──┤gap├── row 2 ──┤gap│        raw formats: rows from top to bottom,
//!          │◀── row_bytes ─▶│                                      pixels from left to right
//!           ▲ width_px pixels of `ImageFormat::pixel_bytes` each
//! ```

use super::BytesView;
use rohrpost_schema::{Bytes, Schema, View};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What the bytes of a pixel are. Numbers of several bytes are little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.ImageFormat")]
pub enum ImageFormat {
    /// Brightness, u8: 0 is black, 255 white.
    #[default]
    Gray8,
    /// Brightness, u16: 0 is black, 65 535 white.
    Gray16,
    /// Red, green, blue, u8 each.
    Rgb8,
    /// Red, green, blue, opacity, u8 each.
    Rgba8,
    /// Blue, green, red, u8 each.
    Bgr8,
    /// Distance along the camera's axis, f32, metres; not a number: not known.
    DepthF32,
    /// Distance along the camera's axis, u16, millimetres; 0: not known.
    Depth16,
    /// A JPEG file.
    Jpeg,
    /// A PNG file.
    Png,
}

impl ImageFormat {
    /// Bytes of a pixel; none if the image is a file, in which pixels have no place of their own.
    ///
    /// ```
    /// use rohrpost_modules::types::ImageFormat;
    ///
    /// assert_eq!((ImageFormat::Rgb8.pixel_bytes(), ImageFormat::Jpeg.pixel_bytes()), (Some(3), None));
    /// ```
    pub const fn pixel_bytes(self) -> Option<u32> {
        match self {
            Self::Gray8 => Some(1),
            Self::Gray16 | Self::Depth16 => Some(2),
            Self::Rgb8 | Self::Bgr8 => Some(3),
            Self::Rgba8 | Self::DepthF32 => Some(4),
            Self::Jpeg | Self::Png => None,
        }
    }
}

/// A picture. It owns its pixels; as [`ImageView`] it sees them where they lie.
///
/// ```
/// use rohrpost_modules::types::{Bytes, Image, ImageFormat, ImageView};
///
/// let image = Image { pixels: Bytes(vec![255; 2 * 6]), ..Image::empty(2, 2, ImageFormat::Rgb8) };
/// image.check()?;
/// let bytes = postcard::to_stdvec(&image)?;
/// let view: ImageView<'_> = postcard::from_bytes(&bytes)?;
/// assert_eq!(view.rows()?.nth(1), Some(&[255; 6][..]));
/// assert!(Image { height_px: 3, ..image }.check().is_err()); // a row is missing
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.Image")]
pub struct Image<B = Bytes> {
    /// Pixels in a row.
    #[schema(unit = "px")]
    pub width_px: u32,
    /// Rows.
    #[schema(unit = "px")]
    pub height_px: u32,
    /// Bytes from the first pixel of a row to that of the next, at least those of the row's pixels; 0 if the image is
    /// a file.
    #[schema(unit = "B")]
    pub row_bytes: u32,
    /// What the bytes of a pixel are.
    pub format: ImageFormat,
    /// All rows, the last as long as the others; or the file.
    pub pixels: B,
}

/// A picture; its pixels are seen where they lie.
pub type ImageView<'a> = Image<BytesView<'a>>;

impl View for Image {
    type View<'a> = ImageView<'a>;
}

/// Why an image is none. `row_bytes`, `width_px` and `height_px` are as the image says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ImageError {
    /// Width or height is 0.
    #[error("an image of {width_px} by {height_px} pixels; both must be at least 1")]
    NoPixels {
        /// Pixels in a row.
        width_px: u32,
        /// Rows.
        height_px: u32,
    },
    /// The pixels of a row do not fit between its start and that of the next.
    #[error("a row of {row_bytes} bytes; {width_px} pixels of {format:?} need at least {least}")]
    ShortRow {
        /// Bytes from row to row.
        row_bytes: u32,
        /// Pixels in a row.
        width_px: u32,
        /// What a pixel is.
        format: ImageFormat,
        /// Bytes that a row needs.
        least: u64,
    },
    /// More or fewer bytes than the rows have.
    #[error("{bytes} bytes of pixels; {height_px} rows of {row_bytes} bytes are {expected}")]
    Length {
        /// Bytes of `pixels`.
        bytes: usize,
        /// Rows.
        height_px: u32,
        /// Bytes from row to row.
        row_bytes: u32,
        /// Bytes that there should be.
        expected: u64,
    },
    /// A file has no rows.
    #[error("a {format:?} file with rows of {row_bytes} bytes; `row_bytes` must be 0")]
    RowsInFile {
        /// Which kind of file.
        format: ImageFormat,
        /// Bytes from row to row.
        row_bytes: u32,
    },
    /// A file without a byte.
    #[error("a {0:?} file of 0 bytes")]
    EmptyFile(ImageFormat),
}

/// Why an image has no rows to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RowsError {
    /// Its sizes do not fit together.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// It is a file.
    #[error("the pixels of a {0:?} file have no place of their own; decode it first")]
    File(ImageFormat),
}

impl Image {
    /// An image without pixels yet, its rows without gaps.
    pub fn empty(width_px: u32, height_px: u32, format: ImageFormat) -> Self {
        // A row that is too long for 32 bits is refused by `check`, as too short.
        let row_bytes = format.pixel_bytes().map_or(0, |bytes| width_px.saturating_mul(bytes));
        Self { width_px, height_px, row_bytes, format, pixels: Bytes::default() }
    }
}

impl<B> Image<B> {
    /// Bytes that its rows take; 0 if the image is a file.
    pub fn raw_bytes(&self) -> u64 {
        u64::from(self.row_bytes) * u64::from(self.height_px)
    }
}

impl<B: AsRef<[u8]>> Image<B> {
    /// Whether its sizes fit together. What a file holds is not looked at.
    ///
    /// # Errors
    /// The first size that does not fit.
    pub fn check(&self) -> Result<(), ImageError> {
        let Self { width_px, height_px, row_bytes, format, .. } = *self;
        if width_px == 0 || height_px == 0 {
            return Err(ImageError::NoPixels { width_px, height_px });
        }
        let (bytes, expected) = (self.pixels.as_ref().len(), self.raw_bytes());
        match format.pixel_bytes() {
            None if row_bytes != 0 => Err(ImageError::RowsInFile { format, row_bytes }),
            None if bytes == 0 => Err(ImageError::EmptyFile(format)),
            None => Ok(()),
            Some(pixel_bytes) => {
                let least = u64::from(width_px) * u64::from(pixel_bytes);
                if u64::from(row_bytes) < least {
                    return Err(ImageError::ShortRow { row_bytes, width_px, format, least });
                }
                if bytes as u64 != expected {
                    return Err(ImageError::Length { bytes, height_px, row_bytes, expected });
                }
                Ok(())
            }
        }
    }

    /// The pixels of each row, from top to bottom, without the gaps.
    ///
    /// # Errors
    /// Sizes that do not fit together, or a file.
    pub fn rows(&self) -> Result<impl ExactSizeIterator<Item = &[u8]>, RowsError> {
        self.check()?;
        let pixel_bytes = self.format.pixel_bytes().ok_or(RowsError::File(self.format))?;
        let shown = (self.width_px * pixel_bytes) as usize;
        Ok(self.pixels.as_ref().chunks_exact(self.row_bytes as usize).map(move |row| &row[..shown]))
    }
}

#[cfg(test)]
#[path = "image_tests.rs"]
mod tests;
