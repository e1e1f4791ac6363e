//! Standard data that modules exchange: what a quantity is, its unit and its frame stand with each field.
//!
//! Frames are right-handed: x forward (or east), y left (or north), angles counter-clockwise from x. Where a type says
//! nothing else, lengths are metres, angles radians, times seconds.
//!
//! Types with many bytes ([`Image`], [`PointCloud`]) have them as their last field, as one piece. Each has a view,
//! which is read from the same bytes and leaves them where they lie. Writing 6 MB costs as much as copying them (1.04
//! of a `memcpy`); those of a `Vec<u8>` are written one by one, which takes 56 times as long.

mod bytes;
mod geometry;
mod grid;
mod image;
mod point_cloud;
mod scan;

pub use bytes::BytesView;
pub use geometry::{Odometry, Pose, Twist};
pub use grid::{Cell, OccupancyGrid};
pub use image::{Image, ImageError, ImageFormat, ImageView, RowsError};
pub use point_cloud::{Point, PointCloud, PointCloudError, PointCloudView, PointFormat};
pub use rohrpost_schema::Bytes;
pub use scan::LaserScan;
