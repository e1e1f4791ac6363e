//! Of what is too long a part is drawn: which pixels and points that are, by content.

use super::TWICE_BYTES_MAX;
use super::drawer::{Drawer, DrawnMessage};
use super::poses::PlanePose;
use super::proto::{PointCloud, RawImage};
use crate::format::{MESSAGE_ENCODING, SCHEMA_ENCODING, key};
use crate::read::definitions::{Definition, SchemaText};
use prost::Message;
use rohrpost_modules::types::{self, Bytes, Image, ImageFormat, LaserScan, PointFormat};
use rohrpost_schema::Data;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is drawn of a value, with a bound or without.
fn drawn<T: Data>(value: &T, bytes_max: Option<usize>) -> Vec<DrawnMessage> {
    let schema = SchemaText::new("its type".into(), SCHEMA_ENCODING.into(), T::schema().to_bytes());
    let channel = Definition {
        topic: "eye.0/sight".into(),
        message_encoding: MESSAGE_ENCODING.into(),
        schema: Arc::new(schema),
        ..Definition::default()
    };
    let mut drawer = Drawer::new(BTreeMap::new(), bytes_max);
    drawer.add(0, &channel).unwrap();
    drawer.draw(0, &channel, 1, &postcard::to_stdvec(value).unwrap()).unwrap()
}

/// The message of a topic, and whether it is told to be reduced.
fn one<M: Message + Default>(drawn: &[DrawnMessage], topic: &str) -> (M, bool) {
    let message = drawn.iter().find(|message| message.channel.topic == topic).unwrap();
    let is_reduced = message.channel.texts.contains_key(key::REDUCED);
    (M::decode(&*message.data).unwrap(), is_reduced)
}

/// Pixels that tell their column and row, with a gap behind each row.
fn picture(width: u32, height: u32, gap: u32) -> Image {
    let row_bytes = width * 3 + gap;
    let row = |y: u32| {
        let pixels = (0..width).flat_map(move |x| [x as u8, y as u8, (x >> 8) as u8]);
        pixels.chain(std::iter::repeat_n(0xee, gap as usize))
    };
    let pixels = Bytes((0..height).flat_map(row).collect());
    Image { row_bytes, pixels, ..Image::empty(width, height, ImageFormat::Rgb8) }
}

#[test]
fn of_a_long_picture_every_kth_pixel_of_every_kth_row_is_drawn() {
    // 640 by 480 pixels fit by every fourth: 160 by 120 are 57600 bytes, and 214 by 160 would be 102720.
    for (width, height, gap, every) in [(640, 480, 0, 4), (641, 481, 5, 4), (320, 240, 0, 2), (145, 150, 20, 1)] {
        let (image, is_reduced) =
            one::<RawImage>(&drawn(&picture(width, height, gap), Some(TWICE_BYTES_MAX)), "eye.0/sight/image");
        let columns: Vec<u32> = (0..width).step_by(every).collect();
        let rows: Vec<u32> = (0..height).step_by(every).collect();
        let wanted: Vec<u8> =
            rows.iter().flat_map(|y| columns.iter().flat_map(|x| [*x as u8, *y as u8, (*x >> 8) as u8])).collect();
        assert_eq!((image.width, image.height), (columns.len() as u32, rows.len() as u32), "{width} by {height}");
        assert_eq!((image.step, image.encoding.as_str()), (image.width * 3, "rgb8"));
        assert!(image.data == wanted && wanted.len() <= TWICE_BYTES_MAX, "{width} by {height}");
        assert_eq!(is_reduced, every > 1, "{width} by {height}");
        let (whole, is_reduced) = one::<RawImage>(&drawn(&picture(width, height, gap), None), "eye.0/sight/image");
        assert_eq!((whole.width, whole.data.len(), is_reduced), (width, (width * height * 3) as usize, false));
    }
}

/// Where a packed point is.
fn places(cloud: &PointCloud) -> Vec<[f32; 3]> {
    let number = |point: &[u8], at: usize| f32::from_le_bytes(point[at..at + 4].try_into().unwrap());
    let points = cloud.data.chunks_exact(cloud.point_stride as usize);
    points.map(|point| [0, 4, 8].map(|at| number(point, at))).collect()
}

#[test]
fn of_a_long_cloud_every_kth_point_that_is_seen_is_drawn() {
    // Every other place is empty. 15000 points of 16 bytes are left, 4096 fit.
    let count = 30_000;
    let point = |number: u32| {
        let x = if number.is_multiple_of(2) { number as f32 } else { f32::NAN };
        [x, -(number as f32), 0.5, 7.0].map(f32::to_le_bytes).concat()
    };
    let points = Bytes((0..count).flat_map(point).collect());
    let cloud = types::PointCloud { points, ..types::PointCloud::empty(count, 1, PointFormat::XyzIntensity) };
    let (drawn_cloud, is_reduced) = one::<PointCloud>(&drawn(&cloud, Some(TWICE_BYTES_MAX)), "eye.0/sight/points");
    let wanted: Vec<[f32; 3]> = (0..count).step_by(2).step_by(4).map(|at| [at as f32, -(at as f32), 0.5]).collect();
    assert!(is_reduced && wanted.len() == 3_750);
    assert_eq!(places(&drawn_cloud), wanted);
    let (whole, is_reduced) = one::<PointCloud>(&drawn(&cloud, None), "eye.0/sight/points");
    assert_eq!((whole.data.len(), is_reduced), (15_000 * 16, false));
}

#[test]
fn each_cloud_has_a_pose() {
    let pose = Some(types::Pose { x_m: 1.0, y_m: 2.0, heading_rad: 0.0 });
    let scan = LaserScan { start_rad: 0.0, step_rad: 0.1, range_max_m: 9.0, ranges_m: vec![1.0], pose: None };
    let cloud = types::PointCloud { points: Bytes(vec![0; 12]), ..types::PointCloud::empty(1, 1, PointFormat::Xyz) };
    for drawn in [drawn(&scan, None), drawn(&LaserScan { pose, ..scan }, None), drawn(&cloud, None)] {
        let (cloud, _) = one::<PointCloud>(&drawn, "eye.0/sight/points");
        assert_eq!(cloud.pose, Some(PlanePose::ORIGIN.in_space()), "{}", cloud.frame_id);
    }
}

#[test]
fn of_a_long_scan_every_kth_beam_is_drawn() {
    let ranges_m: Vec<f32> = (0..20_000).map(|beam| 1.0 + beam as f32).collect();
    let scan = LaserScan { start_rad: 0.0, step_rad: 0.0, range_max_m: 1e6, ranges_m, pose: None };
    let (cloud, is_reduced) = one::<PointCloud>(&drawn(&scan, Some(TWICE_BYTES_MAX)), "eye.0/sight/points");
    let wanted: Vec<[f32; 3]> = (0..20_000).step_by(4).map(|beam| [1.0 + beam as f32, 0.0, 0.0]).collect();
    assert!(is_reduced);
    assert_eq!(places(&cloud), wanted);
}
