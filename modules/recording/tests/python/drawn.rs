//! What is drawn, as Python reads it by the descriptions in the file: each channel with its content.

use super::python;
use super::sights::{long_cloud, long_picture, record, record_drawn, sight, sights};
use rohrpost_recording::{DrawOptions, Selection, draw};

#[test]
fn python_finds_each_drawn_channel_with_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), "base", &sights());
    let to = folder.path().join("drawn.mcap");
    draw(&path, &to, &Selection::default(), &DrawOptions::default(), &mut |_, _| {}).unwrap();
    let quarter = "turned (0 0 0.707 0.707)";
    let wanted = [
        "world/transform: foxglove.FrameTransform world in tf#/ at (0 0 0) turned (0 0 0.000 1.000)".into(),
        format!("odometry.0/odometry/transform: foxglove.FrameTransform odometry.0 in world at (1.5 -2 0) {quarter}"),
        format!("odometry.0/odometry/pose: foxglove.PoseInFrame in world at (1.5 -2 0) {quarter}"),
        "mapper.0/pose/transform: foxglove.FrameTransform mapper.0 in world at (3 4 0) turned (0 0 0.000 1.000)".into(),
        "mapper.0/pose/pose: foxglove.PoseInFrame in world at (3 4 0) turned (0 0 0.000 1.000)".into(),
        format!(
            "pilot.0/path/poses: foxglove.PosesInFrame in world at (0 0 0) turned (0 0 0.000 1.000), \
             (1 0.5 0) {quarter}"
        ),
        "laser.0/scan/points: foxglove.PointCloud in odometry.0: (x=2 y=0 z=0)".into(),
        "laser.1/scan/points: foxglove.PointCloud in world: (x=5 y=8 z=0)".into(),
        "depth.0/points/points: foxglove.PointCloud in odometry.0: \
         (x=1 y=2 z=3 red=255 green=0 blue=0 alpha=255)"
            .into(),
        "camera.0/image/image: foxglove.RawImage of camera.0: 2 by 2 rgb8, rows 0a141e28323c 46505a646e78".into(),
        "camera.1/image/compressed: foxglove.CompressedImage of camera.1: jpeg, b'a file'".into(),
        "output.0/line/log: foxglove.Log WARNING of 1.140.3: 1.140.3: battery low".into(),
    ];
    assert_eq!(python("drawn.py", &[to]), wanted);
}

/// What is drawn while it is recorded, in the same file: of what is long, a part.
#[test]
fn python_finds_the_picture_and_the_points_in_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let all = [sight("camera.0", "image", &long_picture().0), sight("depth.0", "points", &long_cloud().0)];
    let path = record_drawn(folder.path(), 1, &all);
    let (pixels, points) = (long_picture().1, long_cloud().1);
    let wanted = [
        format!(
            "camera.0/image/image: foxglove.RawImage of camera.0: 160 by 120 rgb8, sum {:08x}",
            crc32fast::hash(&pixels)
        ),
        "world/transform: foxglove.FrameTransform world in tf#/ at (0 0 0) turned (0 0 0.000 1.000)".into(),
        format!(
            "depth.0/points/points: foxglove.PointCloud in world: {} bytes, sum {:08x}",
            points.len(),
            crc32fast::hash(&points)
        ),
    ];
    assert_eq!(python("drawn.py", &[path]), wanted);
}
