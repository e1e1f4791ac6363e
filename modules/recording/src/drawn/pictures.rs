//! Pictures: pixels without gaps between their rows, all or some of them, or files as they are.

use super::fields::ValueFields;
use super::proto::{CompressedImage, RawImage};
use rohrpost_schema::Value;

/// A picture in one of two messages.
pub(crate) enum Picture {
    Raw {
        image: RawImage,
        /// It has fewer pixels than the value.
        is_reduced: bool,
    },
    File(CompressedImage),
}

/// None if its sizes do not fit together. If its pixels have more than `bytes_max`, every k-th of every k-th row is
/// left, with the smallest k by which they have not.
pub(crate) fn of_picture(value: Value, bytes_max: usize) -> Option<Picture> {
    let mut image = ValueFields::of(value)?;
    let (width, height) = (image.count("width_px")?, image.count("height_px")?);
    let row_bytes = image.count("row_bytes")?;
    let format = image.word("format")?.to_owned();
    let pixels = image.bytes("pixels").filter(|bytes| width > 0 && height > 0 && !bytes.is_empty())?;
    // By Foxglove's names, those of OpenCV for what is no brightness.
    let (encoding, pixel_bytes) = match format.as_str() {
        "Gray8" => ("mono8", 1),
        "Gray16" => ("mono16", 2),
        "Rgb8" => ("rgb8", 3),
        "Bgr8" => ("bgr8", 3),
        "Rgba8" => ("rgba8", 4),
        "DepthF32" => ("32FC1", 4),
        "Depth16" => ("16UC1", 2),
        "Jpeg" | "Png" => {
            let format = format.to_lowercase();
            return Some(Picture::File(CompressedImage { data: pixels, format, ..CompressedImage::default() }));
        }
        _ => return None,
    };
    let step = width.checked_mul(pixel_bytes).filter(|step| *step <= row_bytes)?;
    if pixels.len() as u64 != u64::from(row_bytes) * u64::from(height) {
        return None;
    }
    let every = every(width, height, pixel_bytes, bytes_max);
    let data = match (every, row_bytes == step) {
        (1, true) => pixels,
        (every, _) => {
            let rows = pixels.chunks_exact(row_bytes as usize).step_by(every as usize);
            let pixels =
                rows.flat_map(|row| row[..step as usize].chunks_exact(pixel_bytes as usize).step_by(every as usize));
            pixels.flatten().copied().collect()
        }
    };
    let (width, height) = (width.div_ceil(every), height.div_ceil(every));
    let step = width * pixel_bytes;
    let image = RawImage { width, height, encoding: encoding.into(), step, data, ..RawImage::default() };
    Some(Picture::Raw { image, is_reduced: every > 1 })
}

/// The k of a picture. One pixel is left however little room there is.
fn every(width: u32, height: u32, pixel_bytes: u32, bytes_max: usize) -> u32 {
    let bytes =
        |every: u32| u128::from(width.div_ceil(every)) * u128::from(height.div_ceil(every)) * u128::from(pixel_bytes);
    let most = width.max(height).max(1);
    (1..most).find(|every| bytes(*every) <= bytes_max as u128).unwrap_or(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_few_pixels_as_needed_are_left_out() {
        for (width, height, pixel_bytes, bytes_max, wanted) in [
            (1, 1, 4, 0, 1),
            (640, 480, 3, usize::MAX, 1),
            (256, 256, 1, 65_536, 1),
            (256, 257, 1, 65_536, 2),
            (320, 240, 3, 65_536, 2),
            (640, 480, 3, 65_536, 4),
            // 214 by 160 pixels would be 102720 bytes, 160 by 120 are 57600.
            (640, 480, 3, 57_600, 4),
            (640, 480, 3, 57_599, 5),
            (1_000_000, 1, 1, 65_536, 16),
            (7, 5, 3, 2, 7),
        ] {
            let told = every(width, height, pixel_bytes, bytes_max);
            assert_eq!(told, wanted, "{width} by {height} pixels of {pixel_bytes} bytes in {bytes_max}");
        }
    }
}
