//! Scans and clouds as packed points: those where something came back.

use super::fields::ValueFields;
use super::poses::PlanePose;
use super::proto::{NumericType, PackedElementField, PointCloud};
use rohrpost_schema::Value;

/// x, y and z.
const PLACE_BYTES: u32 = 12;
/// These and one more number, or a colour.
const MORE_BYTES: u32 = 16;

/// Points, and the frame that they are in, if the value says it.
pub(crate) struct PackedPoints {
    pub(crate) cloud: PointCloud,
    /// They are in the frame of the world.
    pub(crate) is_in_world: bool,
}

impl PackedPoints {
    /// Leaves every k-th point, with the smallest k by which they have at most so many bytes. Whether some are gone.
    pub(crate) fn reduce(&mut self, bytes_max: usize) -> bool {
        let stride = self.cloud.point_stride as usize;
        let count = self.cloud.data.len() / stride;
        let every = count.div_ceil((bytes_max / stride).max(1));
        if every > 1 {
            self.cloud.data = self.cloud.data.chunks_exact(stride).step_by(every).flatten().copied().collect();
        }
        every > 1
    }
}

/// The beams that hit something. If the scan says where its scanner stood, as points of the world.
pub(crate) fn of_scan(value: Value) -> Option<PackedPoints> {
    let mut scan = ValueFields::of(value)?;
    let (start_rad, step_rad) = (scan.finite("start_rad")?, scan.finite("step_rad")?);
    let range_max_m = scan.number("range_max_m")?;
    let stand = match scan.take("pose")? {
        Value::Null => None,
        pose => Some(PlanePose::of(pose)?),
    };
    let Value::List(ranges) = scan.take("ranges_m")? else { return None };
    let mut data = Vec::with_capacity(ranges.len() * PLACE_BYTES as usize);
    for (beam, range) in ranges.into_iter().enumerate() {
        let Value::F(range_m) = range else { return None };
        if !(range_m > 0.0 && range_m < range_max_m && range_m.is_finite()) {
            continue;
        }
        let (sine, cosine) = (start_rad + beam as f64 * step_rad).sin_cos();
        let (x_m, y_m) = (range_m * cosine, range_m * sine);
        let (x_m, y_m) = stand.map_or((x_m, y_m), |stand| stand.carry(x_m, y_m));
        [x_m, y_m, 0.0].iter().for_each(|metres| data.extend_from_slice(&(*metres as f32).to_le_bytes()));
    }
    let cloud = PointCloud { point_stride: PLACE_BYTES, fields: places(), data, ..PointCloud::default() };
    Some(PackedPoints { cloud, is_in_world: stand.is_some() })
}

/// The points that are seen; none if there are more or fewer bytes than points.
pub(crate) fn of_cloud(value: Value) -> Option<PackedPoints> {
    let mut cloud = ValueFields::of(value)?;
    let (columns, rows) = (cloud.count("columns")?, cloud.count("rows")?);
    let mut fields = places();
    let (stride, is_coloured) = match cloud.word("format")? {
        "Xyz" => (PLACE_BYTES, false),
        "XyzIntensity" => {
            fields.push(packed("intensity", PLACE_BYTES, NumericType::Float32));
            (MORE_BYTES, false)
        }
        "XyzRgb" => {
            let names = (PLACE_BYTES..).zip(["red", "green", "blue", "alpha"]);
            fields.extend(names.map(|(offset, name)| packed(name, offset, NumericType::Uint8)));
            (MORE_BYTES, true)
        }
        _ => return None,
    };
    let points = cloud.bytes("points")?;
    if points.len() as u128 != u128::from(columns) * u128::from(rows) * u128::from(stride) {
        return None;
    }
    let mut data = Vec::with_capacity(points.len());
    for point in points.chunks_exact(stride as usize).filter(|point| is_seen(point)) {
        data.extend_from_slice(point);
        if let Some(alpha) = data.last_mut().filter(|_| is_coloured) {
            *alpha = u8::MAX;
        }
    }
    let cloud = PointCloud { point_stride: stride, fields, data, ..PointCloud::default() };
    Some(PackedPoints { cloud, is_in_world: false })
}

/// Where nothing came back the place is no number.
fn is_seen(point: &[u8]) -> bool {
    let (places, _) = point.as_chunks::<4>();
    places.iter().take(3).all(|bytes| f32::from_le_bytes(*bytes).is_finite())
}

fn places() -> Vec<PackedElementField> {
    (0..).step_by(4).zip(["x", "y", "z"]).map(|(offset, name)| packed(name, offset, NumericType::Float32)).collect()
}

fn packed(name: &str, offset: u32, ty: NumericType) -> PackedElementField {
    PackedElementField { name: name.into(), offset, r#type: ty.into() }
}
