//! What is drawn, as Rerun's converter understands it: by content, as it also converts what it shows as bytes only.

use super::sights::{long_cloud, long_picture, record, record_drawn, sight, sights};
use rohrpost_recording::{DrawOptions, Selection, draw};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

const RERUN: &str = "ROHRPOST_RERUN";

/// What Rerun's command line prints.
fn rerun(arguments: &[&str], file: &Path) -> String {
    let program = std::env::var_os(RERUN);
    let program =
        program.unwrap_or_else(|| panic!("{RERUN} is not set; run `cargo xtask test --all`, which installs it"));
    let told = Command::new(program).args(arguments).arg(file).env("NO_COLOR", "1").output().unwrap();
    assert!(told.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&told.stderr));
    String::from_utf8(told.stdout).unwrap()
}

/// Converts a recording, and has Rerun check what it made of it.
fn convert(path: &Path, rrd: &Path) {
    rerun(&["mcap", "convert", "-o", rrd.to_str().unwrap()], path);
    rerun(&["rrd", "verify"], rrd);
}

/// Components of each entity with their values, of chunks with one row. Those about channels are left out.
fn entities(printed: &str) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut all: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    for chunk in printed.split("\nChunk(").skip(1) {
        let cells = |mark: &str| -> Vec<String> {
            let line = chunk.lines().find(|line| line.contains(mark)).unwrap_or_default();
            line.trim_matches(['│', ' ']).split('┆').map(|cell| cell.trim().to_owned()).collect()
        };
        let entity = chunk.split(" - ").nth(1).unwrap().to_owned();
        let (heads, row) = (cells("RowId"), cells(" row_"));
        assert_eq!(heads.len(), row.len(), "{chunk}");
        if !heads.iter().any(|head| head.starts_with("Mcap")) {
            all.entry(entity).or_default().extend(heads.into_iter().zip(row));
        }
    }
    all
}

#[test]
fn rerun_finds_each_drawn_channel_with_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), "base", &sights());
    let (to, rrd) = (folder.path().join("drawn.mcap"), folder.path().join("drawn.rrd"));
    let options = DrawOptions { classes: BTreeMap::from([(140, "pilot".to_owned())]), ..DrawOptions::default() };
    draw(&path, &to, &Selection::default(), &options, &mut |_, _| {}).unwrap();
    convert(&to, &rrd);
    let all = entities(&rerun(&["rrd", "print", "-vvv"], &rrd));
    for (entity, component, wanted) in [
        ("/world/transform", "Transform3D:translation", "[[0.0, 0.0, 0.0]]"),
        ("/world/transform", "Transform3D:child_frame", "[world]"),
        ("/world/transform", "Transform3D:parent_frame", "[tf#/]"),
        ("/odometry.0/odometry/transform", "Transform3D:translation", "[[1.5, -2.0, 0.0]]"),
        ("/odometry.0/odometry/transform", "Transform3D:quaternion", "[[0.0, 0.0, 0.70710677, 0.70710677]]"),
        ("/odometry.0/odometry/transform", "Transform3D:child_frame", "[odometry.0]"),
        ("/odometry.0/odometry/transform", "Transform3D:parent_frame", "[world]"),
        ("/odometry.0/odometry/transform", "timestamp", "2023-11-14T22:13:20.250"),
        ("/mapper.0/pose/pose", "InstancePoses3D:translations", "[[3.0, 4.0, 0.0]]"),
        ("/mapper.0/pose/pose", "CoordinateFrame:frame", "[world]"),
        ("/pilot.0/path/poses", "InstancePoses3D:translations", "[[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]"),
        ("/laser.0/scan/points", "Points3D:positions", "[[2.0, 0.0, 0.0]]"),
        ("/laser.0/scan/points", "CoordinateFrame:frame", "[odometry.0]"),
        ("/laser.1/scan/points", "Points3D:positions", "[[5.0, 8.0, 0.0]]"),
        ("/laser.1/scan/points", "CoordinateFrame:frame", "[world]"),
        ("/depth.0/points/points", "Points3D:positions", "[[1.0, 2.0, 3.0]]"),
        ("/depth.0/points/points", "Points3D:colors", "[4278190335]"),
        ("/camera.0/image/image", "Image:buffer", "[[10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120]]"),
        ("/camera.1/image/compressed", "EncodedImage:media_type", "[image/jpeg]"),
        ("/camera.1/image/compressed", "EncodedImage:blob", "[[97, 32, 102, 105, 108, 101]]"),
        ("/output.0/line/log", "TextLog:text", "[pilot.3: battery low]"),
        ("/output.0/line/log", "TextLog:level", "[WARN]"),
    ] {
        let found = all.get(entity).and_then(|components| components.get(component));
        assert_eq!(found.map(String::as_str), Some(wanted), "{entity} {component} of {all:#?}");
    }
    let format = &all["/camera.0/image/image"]["Image:format"];
    assert!(format.starts_with("[{width: 2, height: 2, "), "{format}");
}

/// A recording that is not exported: the picture and the points of what is long, in part.
#[test]
fn rerun_finds_the_picture_and_the_points_in_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let all = [sight("camera.0", "image", &long_picture().0), sight("depth.0", "points", &long_cloud().0)];
    let (path, rrd) = (record_drawn(folder.path(), 1, &all), folder.path().join("drawn.rrd"));
    convert(&path, &rrd);
    let all = entities(&rerun(&["rrd", "print", "-vvv"], &rrd));
    // Long lists are printed up to some place.
    for (entity, component, wanted) in [
        ("/camera.0/image/image", "Image:buffer", "[[0, 0, 0, 4, 0, 0, 8, 0, 0, 12, 0, 0, "),
        ("/camera.0/image/image", "Image:format", "[{width: 160, height: 120, "),
        ("/depth.0/points/points", "Points3D:positions", "[[0.0, 1.0, -1.0], [2.0, 1.0, -1.0], [4.0, 1.0, -1.0], "),
    ] {
        let found = all.get(entity).and_then(|components| components.get(component));
        assert!(found.is_some_and(|found| found.starts_with(wanted)), "{entity} {component} of {all:#?}");
    }
}
