//! Pictures: pixels without gaps between their rows, or files as they are.

use super::fields::ValueFields;
use super::proto::{CompressedImage, RawImage};
use rohrpost_schema::Value;

/// A picture in one of two messages.
pub(crate) enum Picture {
    Raw(RawImage),
    File(CompressedImage),
}

/// None if its sizes do not fit together.
pub(crate) fn of_picture(value: Value) -> Option<Picture> {
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
    let data = match row_bytes == step {
        true => pixels,
        false => pixels.chunks_exact(row_bytes as usize).flat_map(|row| &row[..step as usize]).copied().collect(),
    };
    Some(Picture::Raw(RawImage { width, height, encoding: encoding.into(), step, data, ..RawImage::default() }))
}
