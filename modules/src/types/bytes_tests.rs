use super::*;
use crate::types::{Bytes, Image, ImageFormat, ImageView, PointCloud, PointCloudView, PointFormat};
use postcard::ser_flavors::Flavor;

/// Counts how it is written to.
#[derive(Default)]
struct Steps {
    single_bytes: usize,
    pieces: usize,
    bytes: usize,
}

impl Flavor for &mut Steps {
    type Output = ();

    fn try_push(&mut self, _: u8) -> postcard::Result<()> {
        self.single_bytes += 1;
        self.bytes += 1;
        Ok(())
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.pieces += 1;
        self.bytes += bytes.len();
        Ok(())
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

fn steps(value: &impl Serialize) -> Steps {
    let mut steps = Steps::default();
    postcard::serialize_with_flavor(value, &mut steps).unwrap();
    steps
}

fn image() -> Image {
    Image { pixels: Bytes((0..18).collect()), ..Image::empty(3, 2, ImageFormat::Rgb8) }
}

fn cloud() -> PointCloud {
    PointCloud { points: Bytes((0..24).collect()), ..PointCloud::empty(2, 1, PointFormat::Xyz) }
}

fn view_of<'a, V: Deserialize<'a>>(bytes: &'a [u8]) -> V {
    postcard::from_bytes(bytes).unwrap()
}

#[test]
fn six_megabytes_are_written_as_one_piece() {
    let pixels = Bytes(vec![7; 6_000_000]);
    let image = Image { pixels, ..Image::empty(2000, 1000, ImageFormat::Rgb8) };
    let by_pieces = steps(&image);
    assert!(by_pieces.bytes > 6_000_000);
    assert!(by_pieces.single_bytes + by_pieces.pieces <= 10, "numbers and their lengths, and the pixels");
    let by_elements = steps(&image.pixels.0);
    assert!(by_elements.single_bytes >= 6_000_000, "a `Vec<u8>` alone would show here: {}", by_elements.single_bytes);
}

#[test]
fn a_view_has_the_description_and_the_bytes_of_the_value() {
    assert_eq!(Image::<Bytes>::schema(), ImageView::schema());
    assert_eq!(PointCloud::<Bytes>::schema(), PointCloudView::schema());
    let bytes = postcard::to_stdvec(&image()).unwrap();
    let view: ImageView<'_> = view_of(&bytes);
    assert_eq!(postcard::to_stdvec(&view).unwrap(), bytes);
    let Image { width_px, height_px, row_bytes, format, pixels } = image();
    assert_eq!(view, Image { width_px, height_px, row_bytes, format, pixels: BytesView(&pixels) });
    let bytes = postcard::to_stdvec(&cloud()).unwrap();
    let view: PointCloudView<'_> = view_of(&bytes);
    assert_eq!(postcard::to_stdvec(&view).unwrap(), bytes);
}

#[test]
fn a_view_lies_in_the_bytes_that_it_was_read_from() {
    let check = |seen: &[u8], length: usize, bytes: &[u8]| {
        assert_eq!(seen.len(), length);
        assert_eq!(seen.as_ptr_range(), bytes[bytes.len() - length..].as_ptr_range(), "they are the last of a value");
    };
    let bytes = postcard::to_stdvec(&image()).unwrap();
    check(&view_of::<ImageView<'_>>(&bytes).pixels, 18, &bytes);
    let bytes = postcard::to_stdvec(&cloud()).unwrap();
    check(&view_of::<PointCloudView<'_>>(&bytes).points, 24, &bytes);
}

#[test]
fn an_owner_reads_what_it_wrote() {
    let (image, cloud) = (image(), cloud());
    assert_eq!(postcard::from_bytes::<Image>(&postcard::to_stdvec(&image).unwrap()), Ok(image));
    assert_eq!(postcard::from_bytes::<PointCloud>(&postcard::to_stdvec(&cloud).unwrap()), Ok(cloud));
}

#[test]
fn bytes_that_are_cut_are_no_value() {
    let bytes = postcard::to_stdvec(&image()).unwrap();
    for length in 0..bytes.len() {
        assert!(postcard::from_bytes::<Image>(&bytes[..length]).is_err());
        assert!(postcard::from_bytes::<ImageView<'_>>(&bytes[..length]).is_err());
    }
}
