use super::*;

fn image(width_px: u32, height_px: u32, row_bytes: u32, format: ImageFormat, bytes: usize) -> Image {
    Image { width_px, height_px, row_bytes, format, pixels: Bytes(vec![0; bytes]) }
}

#[test]
fn sizes_must_fit_together() {
    use ImageFormat::{Depth16, DepthF32, Gray8, Gray16, Jpeg, Png, Rgb8, Rgba8};
    let short = |row_bytes, width_px, format, least| Err(ImageError::ShortRow { row_bytes, width_px, format, least });
    let length =
        |bytes, height_px, row_bytes, expected| Err(ImageError::Length { bytes, height_px, row_bytes, expected });
    for (image, expected, why) in [
        (image(3, 2, 3, Gray8, 6), Ok(()), "rows without gaps"),
        (image(3, 2, 8, Gray16, 16), Ok(()), "a gap of two bytes behind each row"),
        (image(1, 1, 4, DepthF32, 4), Ok(()), "one pixel"),
        (image(640, 480, 0, Jpeg, 1), Ok(()), "what is in a file is not looked at"),
        (image(0, 2, 0, Gray8, 0), Err(ImageError::NoPixels { width_px: 0, height_px: 2 }), "no columns"),
        (image(2, 0, 2, Gray8, 0), Err(ImageError::NoPixels { width_px: 2, height_px: 0 }), "no rows"),
        (image(0, 1, 0, Png, 9), Err(ImageError::NoPixels { width_px: 0, height_px: 1 }), "a file has a size, too"),
        (image(3, 2, 8, Rgb8, 16), short(8, 3, Rgb8, 9), "rows that run into each other"),
        (image(3, 2, 6, Depth16, 11), length(11, 2, 6, 12), "a byte is missing"),
        (image(3, 2, 6, Depth16, 13), length(13, 2, 6, 12), "a byte too many"),
        (image(1, u32::MAX, u32::MAX, Rgba8, 0), length(0, u32::MAX, u32::MAX, 0xffff_fffe_0000_0001), "no overflow"),
        (image(u32::MAX, 1, u32::MAX, Rgba8, 0), short(u32::MAX, u32::MAX, Rgba8, 0x3_ffff_fffc), "nor here"),
        (image(8, 8, 24, Png, 9), Err(ImageError::RowsInFile { format: Png, row_bytes: 24 }), "rows in a file"),
        (image(8, 8, 0, Jpeg, 0), Err(ImageError::EmptyFile(Jpeg)), "nothing in a file"),
    ] {
        assert_eq!(image.check(), expected, "{why}");
    }
}

#[test]
fn an_empty_image_says_how_many_bytes_it_needs() {
    for (format, bytes) in
        [(ImageFormat::Rgb8, 640 * 480 * 3), (ImageFormat::Gray16, 640 * 480 * 2), (ImageFormat::Png, 0)]
    {
        let image = Image::empty(640, 480, format);
        assert_eq!(image.raw_bytes(), bytes);
        let filled = Image { pixels: Bytes(vec![1; bytes.max(1) as usize]), ..image };
        assert_eq!(filled.check(), Ok(()));
    }
    let endless = Image::empty(u32::MAX, 1, ImageFormat::Rgb8);
    assert!(matches!(endless.check(), Err(ImageError::ShortRow { .. })), "saturated, and found");
}

#[test]
fn rows_leave_the_gaps_out() {
    let pixels = Bytes(vec![1, 2, 3, 4, 99, 5, 6, 7, 8, 99]);
    let image = Image { width_px: 2, height_px: 2, row_bytes: 5, format: ImageFormat::Gray16, pixels };
    assert_eq!(image.rows().unwrap().collect::<Vec<_>>(), [[1, 2, 3, 4], [5, 6, 7, 8]]);
}

#[test]
fn what_has_no_rows_says_why() {
    let file = image(8, 8, 0, ImageFormat::Jpeg, 5);
    assert_eq!(file.rows().err(), Some(RowsError::File(ImageFormat::Jpeg)));
    let cut = image(8, 8, 8, ImageFormat::Gray8, 63);
    assert_eq!(
        cut.rows().err().map(|error| error.to_string()).as_deref(),
        Some("63 bytes of pixels; 8 rows of 8 bytes are 64")
    );
}
