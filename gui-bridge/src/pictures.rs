//! Pictures of cameras: colours, depths, and files as they come.

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use rerun::blueprint::Spatial2DView;
use rerun::components::Blob;
use rerun::{AsComponents, ChannelDatatype, ColorModel, DepthImage, EncodedImage, EntityPath, MediaType};
use rohrpost::schema::DataItem;
use rohrpost::types::{Image, ImageFormat};

/// Draws what cameras see, whatever module has one.
pub(crate) struct Pictures;

impl View for Pictures {
    fn wants(&self, _: &rohrpost::schema::Description, item: &DataItem) -> bool {
        is::<Image>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.picture(datum.module, &datum.item.field.name, &datum.view::<Image>()?)
    }

    /// Each has a tab of its own, since one picture would hide another.
    fn tab_of(&self, module: &str, item: &DataItem) -> Option<Tab> {
        let name = format!("{module} {}", item.field.name);
        let (title, origin) = (name.clone(), place(module, &item.field.name));
        Some(Tab::own(&name, move || Spatial2DView::new(title.as_str()).with_origin(origin.clone())).beside())
    }
}

fn place(module: &str, item: &str) -> EntityPath {
    entity(&["pictures", module, item])
}

impl Scene {
    /// A picture that `module` gives under the name `item`, as the entity `pictures/MODULE/ITEM`. Its pixels are copied
    /// once; files (JPEG, PNG) stay as they are, and the viewer decodes them.
    ///
    /// # Errors
    /// Its sizes do not fit together, or it is larger than [`crate::LARGE_BYTES_MAX`].
    pub fn picture<B: AsRef<[u8]>>(&mut self, module: &str, item: &str, image: &Image<B>) -> Result<(), DrawError> {
        image.check().map_err(|why| DrawError::sizes(module, item, &why))?;
        DrawError::unless_larger(module, item, image.pixels.as_ref().len())?;
        self.log(place(module, item), &*drawn(image));
        Ok(())
    }
}

/// A picture as Rerun has it; its sizes fit together.
fn drawn<B: AsRef<[u8]>>(image: &Image<B>) -> Box<dyn AsComponents> {
    let size = [image.width_px, image.height_px];
    let colours = |model, channel| -> Box<dyn AsComponents> {
        Box::new(rerun::Image::from_color_model_and_bytes(packed(image), size, model, channel))
    };
    let depths = |channel, metre: f32| -> Box<dyn AsComponents> {
        Box::new(DepthImage::from_data_type_and_bytes(packed(image), size, channel).with_meter(metre))
    };
    let file = |kind| -> Box<dyn AsComponents> {
        Box::new(EncodedImage::new(Blob::from(image.pixels.as_ref().to_vec())).with_media_type(kind))
    };
    match image.format {
        ImageFormat::Gray8 => colours(ColorModel::L, ChannelDatatype::U8),
        ImageFormat::Gray16 => colours(ColorModel::L, ChannelDatatype::U16),
        ImageFormat::Rgb8 => colours(ColorModel::RGB, ChannelDatatype::U8),
        ImageFormat::Rgba8 => colours(ColorModel::RGBA, ChannelDatatype::U8),
        ImageFormat::Bgr8 => colours(ColorModel::BGR, ChannelDatatype::U8),
        ImageFormat::DepthF32 => depths(ChannelDatatype::F32, 1.0),
        ImageFormat::Depth16 => depths(ChannelDatatype::U16, 1000.0),
        ImageFormat::Jpeg => file(MediaType::jpeg()),
        ImageFormat::Png => file(MediaType::png()),
    }
}

/// The rows without the gaps between them.
fn packed<B: AsRef<[u8]>>(image: &Image<B>) -> Vec<u8> {
    let rows: Vec<&[u8]> = image.rows().map(Iterator::collect).unwrap_or_default();
    rows.concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;
    use rohrpost::types::Bytes;

    fn image(format: ImageFormat, row_bytes: u32, pixels: Vec<u8>) -> Image {
        Image { width_px: 2, height_px: 2, row_bytes, format, pixels: Bytes(pixels) }
    }

    #[test]
    fn each_format_is_drawn_as_what_it_is() {
        let mut drawing = TestScene::new();
        for (format, row_bytes, bytes, archetype) in [
            (ImageFormat::Gray8, 2, 4, "Image"),
            (ImageFormat::Gray16, 4, 8, "Image"),
            (ImageFormat::Rgb8, 6, 12, "Image"),
            (ImageFormat::Rgba8, 8, 16, "Image"),
            (ImageFormat::Bgr8, 6, 12, "Image"),
            (ImageFormat::DepthF32, 8, 16, "DepthImage"),
            (ImageFormat::Depth16, 4, 8, "DepthImage"),
            (ImageFormat::Jpeg, 0, 100, "EncodedImage"),
            (ImageFormat::Png, 0, 100, "EncodedImage"),
        ] {
            drawing.components();
            drawing.scene.picture("camera.0", "image", &image(format, row_bytes, vec![7; bytes])).unwrap();
            let all = drawing.components();
            let components = &all["/pictures/camera.0/image"];
            let bytes_of = ["buffer", "blob"].map(|part| components.get(&format!("{archetype}:{part}")).copied());
            assert_eq!(bytes_of.into_iter().flatten().collect::<Vec<_>>(), [bytes], "{format:?}: {components:?}");
        }
    }

    #[test]
    fn gaps_between_rows_are_left_out() {
        let gapped = image(ImageFormat::Rgb8, 8, (0..16).collect());
        assert_eq!(packed(&gapped), [0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13]);
    }

    #[test]
    fn pictures_that_cannot_be_true_or_are_too_large_are_refused() {
        let mut drawing = TestScene::new();
        let short = image(ImageFormat::Rgb8, 6, vec![0; 11]);
        let side = 6000;
        let large =
            Image { pixels: Bytes(vec![0; side * side]), ..Image::empty(side as u32, side as u32, ImageFormat::Gray8) };
        let said = [short, large].map(|image| drawing.scene.picture("c.0", "image", &image).unwrap_err().to_string());
        assert_eq!(
            said,
            [
                "image of c.0: 11 bytes of pixels; 2 rows of 6 bytes are 12; its sender is at fault",
                "image of c.0 has 36000000 bytes, and no more than 33554432 are drawn of one thing; send it smaller, \
                 or as JPEG",
            ]
        );
        assert!(!drawing.components().contains_key("/pictures/c.0/image"));
    }
}
