//! Points in space: what a depth sensor or a turning scanner sees.
//!
//! ```text
//! points   x y z | x y z | ...            `PointFormat::Xyz`, 12 bytes a point
//!          x y z i | x y z i | ...        `PointFormat::XyzIntensity`, 16 bytes
//!          x y z rgb0 | x y z rgb0 | ...  `PointFormat::XyzRgb`, 16 bytes
//! ```
//!
//! x, y, z and i are little-endian f32; r, g, b are one byte each, and one more is 0.

use super::BytesView;
use rohrpost_schema::{Bytes, Schema, View};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What the bytes of a point are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.PointFormat")]
pub enum PointFormat {
    /// x, y, z: three f32.
    #[default]
    Xyz,
    /// x, y, z, and how much came back, in the sensor's own unit: four f32.
    XyzIntensity,
    /// x, y, z: three f32; red, green, blue and 0: four u8.
    XyzRgb,
}

impl PointFormat {
    /// Bytes of a point.
    pub const fn point_bytes(self) -> usize {
        match self {
            Self::Xyz => 12,
            Self::XyzIntensity | Self::XyzRgb => 16,
        }
    }
}

/// Points in the frame of their sensor. It owns their bytes; as [`PointCloudView`] it sees them where they lie.
///
/// A sensor that sees in rows and columns, as a camera does, says how many: point `row * columns + column` is the one
/// seen there, from top to bottom and from left to right. Other clouds have one row.
///
/// ```
/// use rohrpost_modules::types::{Bytes, PointCloud, PointFormat};
///
/// let points = Bytes([1.5f32, 0.0, -0.5].iter().flat_map(|metres| metres.to_le_bytes()).collect());
/// let cloud = PointCloud { columns: 1, rows: 1, format: PointFormat::Xyz, points };
/// let point = cloud.points()?.next().unwrap();
/// assert_eq!((point.x_m, point.y_m, point.z_m), (1.5, 0.0, -0.5));
/// assert!(PointCloud { rows: 2, ..cloud }.points().is_err()); // a row is missing
/// # Ok::<(), rohrpost_modules::types::PointCloudError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[schema(name = "rohrpost.PointCloud")]
pub struct PointCloud<B = Bytes> {
    /// Points in a row.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// What the bytes of a point are.
    pub format: PointFormat,
    /// The points, without gaps: x forward, y left, z up from the sensor, metres. All three are not a number where
    /// nothing came back.
    pub points: B,
}

/// A cloud; its points are seen where they lie.
pub type PointCloudView<'a> = PointCloud<BytesView<'a>>;

impl View for PointCloud {
    type View<'a> = PointCloudView<'a>;
}

/// One point of a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Metres forward of the sensor; not a number where nothing came back.
    pub x_m: f32,
    /// Metres left of it.
    pub y_m: f32,
    /// Metres above it.
    pub z_m: f32,
    /// How much came back, in the sensor's own unit, if the format has it.
    pub intensity: Option<f32>,
    /// Red, green, blue, if the format has them.
    pub rgb: Option<[u8; 3]>,
}

/// More or fewer bytes than the points have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{bytes} bytes of points; {columns} columns and {rows} rows of {format:?} are {expected}")]
pub struct PointCloudError {
    /// Bytes of `points`.
    pub bytes: usize,
    /// Points in a row.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// What a point is.
    pub format: PointFormat,
    /// Bytes that there should be.
    pub expected: u128,
}

impl Point {
    /// Whether something came back there.
    pub fn is_seen(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.z_m.is_finite()
    }

    /// From the bytes of one point, as many as `format` has.
    fn read(format: PointFormat, bytes: &[u8]) -> Self {
        let four = |word: usize| -> [u8; 4] { std::array::from_fn(|index| bytes[4 * word + index]) };
        let number = |word| f32::from_le_bytes(four(word));
        let (intensity, rgb) = match format {
            PointFormat::Xyz => (None, None),
            PointFormat::XyzIntensity => (Some(number(3)), None),
            PointFormat::XyzRgb => {
                let [red, green, blue, _] = four(3);
                (None, Some([red, green, blue]))
            }
        };
        Self { x_m: number(0), y_m: number(1), z_m: number(2), intensity, rgb }
    }
}

impl PointCloud {
    /// A cloud without points yet.
    pub fn empty(columns: u32, rows: u32, format: PointFormat) -> Self {
        Self { columns, rows, format, points: Bytes::default() }
    }
}

impl<B> PointCloud<B> {
    /// Bytes that its points take.
    pub fn raw_bytes(&self) -> u128 {
        u128::from(self.columns) * u128::from(self.rows) * self.format.point_bytes() as u128
    }
}

impl<B: AsRef<[u8]>> PointCloud<B> {
    /// Whether there are as many bytes as points. A cloud without points is one, too.
    ///
    /// # Errors
    /// How many there are, and how many there should be.
    pub fn check(&self) -> Result<(), PointCloudError> {
        let Self { columns, rows, format, .. } = *self;
        let (bytes, expected) = (self.points.as_ref().len(), self.raw_bytes());
        if bytes as u128 != expected {
            return Err(PointCloudError { bytes, columns, rows, format, expected });
        }
        Ok(())
    }

    /// The points, row by row; also those where nothing came back ([`Point::is_seen`]).
    ///
    /// # Errors
    /// More or fewer bytes than the points have.
    pub fn points(&self) -> Result<impl ExactSizeIterator<Item = Point>, PointCloudError> {
        self.check()?;
        let format = self.format;
        Ok(self.points.as_ref().chunks_exact(format.point_bytes()).map(move |bytes| Point::read(format, bytes)))
    }
}

#[cfg(test)]
#[path = "point_cloud_tests.rs"]
mod tests;
