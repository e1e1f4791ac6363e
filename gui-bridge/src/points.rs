//! Points of depth sensors and turning scanners, in space.
//!
//! They lie below `points`, beside `world`: that is flat, with a transform that turns y up, which would mirror what has
//! three dimensions. The frame is the same, with z up. The tab shows them in the sensor's frame, so that they
//! stay in sight while the robot drives and turns.

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::palette;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use crate::world::placed;
use rerun::external::arrow::array::{FixedSizeListArray, Float32Array, UInt32Array};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::{EntityPath, Points3D, Radius, SerializedComponentBatch};
use rohrpost::schema::{DataItem, Description};
use rohrpost::types::{Point, PointCloud};
use std::sync::Arc;

/// Draws clouds, whatever module has them.
pub(crate) struct Clouds;

impl View for Clouds {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<PointCloud>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let carrier = scene.carrier().to_owned();
        scene.points(datum.module, &datum.item.field.name, &datum.view::<PointCloud>()?, &carrier)
    }

    /// One for all clouds, in the frame of the first.
    fn tab_of(&self, module: &str, item: &DataItem) -> Option<Tab> {
        Some(Tab::space("Points", place(module, &item.field.name), &["/points/**"]).beside())
    }
}

fn place(module: &str, item: &str) -> EntityPath {
    entity(&["points", module, item])
}

impl Scene {
    /// A cloud that `module` gives under the name `item`, as the entity `points/MODULE/ITEM`: where the sensor saw
    /// something, from the last pose drawn for `carrier`. Points have their own colours; else they are the brighter the
    /// more came back, or the higher they are.
    ///
    /// # Errors
    /// Its sizes do not fit together, or it is larger than [`crate::LARGE_BYTES_MAX`].
    pub fn points<B: AsRef<[u8]>>(
        &mut self,
        module: &str,
        item: &str,
        cloud: &PointCloud<B>,
        carrier: &str,
    ) -> Result<(), DrawError> {
        DrawError::unless_larger(module, item, cloud.points.as_ref().len())?;
        let points = cloud.points().map_err(|why| DrawError::sizes(module, item, &why))?;
        let (places_m, colours) = coloured(points.filter(Point::is_seen));
        let drawn = drawn(places_m, colours).with_radii([Radius::new_ui_points(1.5)]);
        let place = place(module, item);
        self.log(place.clone(), &placed(&self.pose_of(carrier), 1.0));
        self.log(place, &drawn);
        Ok(())
    }
}

/// Points as Rerun has them, made of whole arrays: made of its own types one by one, 200 000 of them took seconds in a
/// bridge of which Rerun is not optimised.
fn drawn(places_m: Vec<f32>, colours: Vec<u32>) -> Points3D {
    let number = Arc::new(Field::new("item", DataType::Float32, false));
    let places = FixedSizeListArray::new(number, 3, Arc::new(Float32Array::from(places_m)), None);
    let (of_places, of_colours) = (Points3D::descriptor_positions(), Points3D::descriptor_colors());
    Points3D {
        positions: Some(SerializedComponentBatch::new(Arc::new(places), of_places)),
        colors: Some(SerializedComponentBatch::new(Arc::new(UInt32Array::from(colours)), of_colours)),
        ..Points3D::update_fields()
    }
}

/// Places of points, x, y and z in turn, and their colours, 0xRRGGBBAA.
fn coloured(points: impl Iterator<Item = Point>) -> (Vec<f32>, Vec<u32>) {
    let (mut places_m, mut shades) = (Vec::new(), Vec::new());
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    for point in points {
        places_m.extend_from_slice(&[point.x_m, point.y_m, point.z_m]);
        let shade = point.intensity.unwrap_or(point.z_m);
        shades.push((point.rgb, shade));
        (least, most) = (least.min(shade), most.max(shade));
    }
    let opaque = |[red, green, blue]: palette::Rgb| u32::from_be_bytes([red, green, blue, u8::MAX]);
    let table: [u32; 256] = std::array::from_fn(|step| opaque(palette::shaded(step as f32 / 255.0)));
    let steps = 255.0 / (most - least);
    // If all are the same, that is not a number, which becomes 0.
    let colour = |(rgb, shade): (Option<palette::Rgb>, f32)| match rgb {
        Some(rgb) => opaque(rgb),
        None => table[usize::from(((shade - least) * steps) as u8)],
    };
    (places_m, shades.into_iter().map(colour).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;
    use rohrpost::types::{Bytes, Odometry, PointFormat, Pose};

    fn cloud(format: PointFormat, words: &[[f32; 4]]) -> PointCloud {
        let numbers = format.point_bytes() / 4;
        let points = words.iter().flat_map(|point| point[..numbers].iter().flat_map(|word| word.to_le_bytes()));
        PointCloud { columns: words.len() as u32, rows: 1, format, points: Bytes(points.collect()) }
    }

    fn colours(cloud: &PointCloud) -> Vec<[u8; 3]> {
        let (_, colours) = coloured(cloud.points().unwrap());
        let rgb = |colour: &u32| {
            let [red, green, blue, _] = colour.to_be_bytes();
            [red, green, blue]
        };
        colours.iter().map(rgb).collect()
    }

    #[test]
    fn a_cloud_lies_where_its_carrier_is_without_what_was_not_seen() {
        let mut drawing = TestScene::new();
        let pose = Pose { x_m: 5.0, ..Pose::default() };
        drawing.scene.odometry("odometry.0", &Odometry { pose, ..Odometry::default() });
        drawing.components();
        let nothing = [f32::NAN; 4];
        let cloud = cloud(PointFormat::Xyz, &[[1.0, 2.0, 3.0, 0.0], nothing, [4.0, 5.0, 6.0, 0.0]]);
        drawing.scene.points("depth.0", "points", &cloud, "odometry.0").unwrap();
        let all = drawing.components();
        let components = &all["/points/depth.0/points"];
        let of = |component: &str| components.get(component).copied();
        assert_eq!((of("Points3D:positions"), of("Points3D:colors")), (Some(2 * 3), Some(2)), "{components:?}");
        assert_eq!(of("Transform3D:translation"), Some(3), "{components:?}");
        assert_eq!(drawing.scene.pose_of("odometry.0"), pose);
    }

    #[test]
    fn points_have_their_own_colours_or_are_brighter_the_more_came_back_or_the_higher_they_are() {
        let (dark, bright) = (palette::shaded(0.0), palette::shaded(1.0));
        let low_high = [[0.0, 0.0, -1.0, 9.0], [0.0, 0.0, 2.0, 3.0]];
        assert_eq!(colours(&cloud(PointFormat::Xyz, &low_high)), [dark, bright]);
        assert_eq!(colours(&cloud(PointFormat::XyzIntensity, &low_high)), [bright, dark]);
        let green = f32::from_le_bytes([1, 200, 3, 0]);
        assert_eq!(colours(&cloud(PointFormat::XyzRgb, &[[0.0, 0.0, 0.0, green]])), [[1, 200, 3]]);
        assert_eq!(colours(&cloud(PointFormat::Xyz, &low_high[..1])), [dark], "one height alone");
    }

    #[test]
    fn a_cloud_that_cannot_be_true_is_refused() {
        let mut drawing = TestScene::new();
        let short = PointCloud { rows: 2, ..cloud(PointFormat::Xyz, &[[0.0; 4]]) };
        let said = drawing.scene.points("d.0", "points", &short, "").unwrap_err().to_string();
        assert_eq!(
            said,
            "points of d.0: 12 bytes of points; 1 columns and 2 rows of Xyz are 24; its sender is at fault"
        );
    }
}
