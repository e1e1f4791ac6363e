use super::*;

/// One point of a format, written by hand.
fn bytes(numbers: &[f32], rest: &[u8]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).chain(rest.iter().copied()).collect()
}

#[test]
fn points_are_read_as_their_format_says() {
    let place = [1.5, -2.0, 0.25];
    let point = Point { x_m: 1.5, y_m: -2.0, z_m: 0.25, ..Point::default() };
    for (format, second, expected) in [
        (PointFormat::Xyz, bytes(&place, &[]), point),
        (PointFormat::XyzIntensity, bytes(&[1.5, -2.0, 0.25, 17.0], &[]), Point { intensity: Some(17.0), ..point }),
        (PointFormat::XyzRgb, bytes(&place, &[10, 20, 30, 0]), Point { rgb: Some([10, 20, 30]), ..point }),
    ] {
        let points = Bytes([vec![0; format.point_bytes()], second].concat());
        let cloud = PointCloud { columns: 2, rows: 1, format, points };
        assert_eq!(cloud.points().unwrap().nth(1), Some(expected), "{format:?}");
    }
}

#[test]
fn there_are_as_many_bytes_as_points() {
    for (columns, rows, format, bytes, expected) in [
        (2, 3, PointFormat::Xyz, 72, None),
        (2, 3, PointFormat::XyzRgb, 96, None),
        (0, 0, PointFormat::Xyz, 0, None),
        (2, 3, PointFormat::Xyz, 71, Some(72)),
        (2, 3, PointFormat::XyzIntensity, 97, Some(96)),
        (u32::MAX, u32::MAX, PointFormat::XyzIntensity, 16, Some(u128::from(u32::MAX).pow(2) * 16)),
    ] {
        let cloud = PointCloud { columns, rows, format, points: Bytes(vec![0; bytes]) };
        let expected = expected.map(|expected| PointCloudError { bytes, columns, rows, format, expected });
        assert_eq!(cloud.check().err(), expected);
        assert_eq!(cloud.points().err(), expected);
    }
}

#[test]
fn points_where_nothing_came_back_are_known() {
    let nothing = Point { x_m: f32::NAN, y_m: f32::NAN, z_m: f32::NAN, ..Point::default() };
    assert!(Point::default().is_seen());
    assert!(!nothing.is_seen());
    assert!(!Point { z_m: f32::INFINITY, ..Point::default() }.is_seen());
}
