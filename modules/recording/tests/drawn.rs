//! What is drawn of a recording, how it is marked, and what is left out.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "common/sights.rs"]
mod sights;

use rohrpost_modules::types::{Bytes, Image, ImageFormat};
use rohrpost_recording::{
    DrawError, DrawOptions, Drawn, DrawnBeside, Options, ReadError, Reader, RewriteError, SelectError, Selection, cut,
    draw, info, merge,
};
use sights::{Sight, line, long_cloud, long_picture, pose, record, record_drawn, record_files, scan, sight, sights};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

struct Drawing {
    folder: TempDir,
    to: PathBuf,
    told: Drawn,
}

impl Drawing {
    fn of(sights: &[Sight], selection: &Selection, with_original: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = record(folder.path(), "base", sights);
        let to = folder.path().join("drawn.mcap");
        let told = draw(&path, &to, selection, &options(with_original), &mut |_, _| {}).unwrap();
        Self { folder, to, told }
    }

    fn all(sights: &[Sight]) -> Self {
        Self::of(sights, &Selection::default(), false)
    }
}

fn options(with_original: bool) -> DrawOptions {
    DrawOptions { with_original, ..DrawOptions::default() }
}

/// Topics of a file, with the name of each type.
fn topics(path: &Path) -> Vec<(String, String)> {
    info(path)
        .unwrap()
        .channels
        .into_iter()
        .map(|channel| (channel.topic.to_string(), channel.type_name.to_string()))
        .collect()
}

#[test]
fn each_kind_of_sight_is_drawn_and_marked() {
    let drawing = Drawing::all(&sights());
    let wanted = [
        ("camera.0/image/image", "foxglove.RawImage"),
        ("camera.1/image/compressed", "foxglove.CompressedImage"),
        ("depth.0/points/points", "foxglove.PointCloud"),
        ("laser.0/scan/points", "foxglove.PointCloud"),
        ("laser.1/scan/points", "foxglove.PointCloud"),
        ("mapper.0/pose/pose", "foxglove.PoseInFrame"),
        ("mapper.0/pose/transform", "foxglove.FrameTransform"),
        ("odometry.0/odometry/pose", "foxglove.PoseInFrame"),
        ("odometry.0/odometry/transform", "foxglove.FrameTransform"),
        ("output.0/line/log", "foxglove.Log"),
        ("pilot.0/path/poses", "foxglove.PosesInFrame"),
        ("world/transform", "foxglove.FrameTransform"),
    ];
    assert_eq!(topics(&drawing.to), wanted.map(|(topic, ty)| (topic.to_owned(), ty.to_owned())));
    assert!(drawing.told.drawn.iter().map(|(topic, count)| (topic.as_str(), *count)).eq(wanted.map(|its| (its.0, 1))));
    assert_eq!(drawing.told.without, ["motor.0/speed"]);
    assert_eq!(drawing.told.carrier.as_deref(), Some("odometry.0"));
    assert!(drawing.told.not_drawn.is_empty() && drawing.told.too_long.is_empty(), "{:?}", drawing.told);
    let told = info(&drawing.to).unwrap();
    assert_eq!((told.messages, told.bytes), (drawing.told.messages, drawing.told.bytes));
    assert_eq!(told.session["node"], "base");
    for channel in told.channels {
        // Where the world is, is said with the first that has a place in it.
        let source = channel.topic.replace("world", "odometry.0/odometry").rsplit_once('/').unwrap().0.to_owned();
        assert_eq!((channel.drawn_of, channel.message_encoding.as_str()), (Some(source.into()), "protobuf"));
    }
}

/// The times, epoch and numbers are those of the source, and so is the order.
#[test]
fn what_is_drawn_keeps_its_times() {
    let drawing = Drawing::of(&sights(), &Selection::default(), true);
    let mut reader = Reader::open(&drawing.to).unwrap();
    let mut source = None;
    let (mut copied, mut drawn) = (0, 0);
    while let Some((channel, message)) = reader.next().unwrap() {
        let times = (message.stamp_ns, message.arrival_ns, message.epoch, message.sequence);
        if channel.is_drawn() {
            let (topic, its) = source.clone().unwrap();
            assert_eq!((&channel.texts["drawn"], times), (&topic, its));
            drawn += 1;
        } else {
            source = Some((channel.topic.to_string(), times));
            copied += 1;
        }
    }
    assert_eq!((copied, drawn), (10, 12));
}

#[test]
fn cut_and_merge_keep_what_is_drawn_and_drawing_again_does_not_double_it() {
    let drawing = Drawing::of(&sights(), &Selection::default(), true);
    let file = |name: &str| drawing.folder.path().join(name);
    for name in ["laser.0", "laser.0/scan"] {
        let part = file("part.mcap");
        let selection = Selection { names: vec![name.into()], ..Selection::default() };
        assert_eq!(cut(&drawing.to, &part, &selection, &mut |_, _| {}).unwrap().0, 2, "{name}");
        assert_eq!(info(&part).unwrap().channels[1].drawn_of.as_deref(), Some("laser.0/scan"));
        std::fs::remove_file(&part).unwrap();
    }
    let other = record(drawing.folder.path(), "other", &sights());
    let merged = file("merged.mcap");
    assert_eq!(merge(&[drawing.to.clone(), other], &merged, &mut |_, _| {}).unwrap().0, 32);
    let again = file("again.mcap");
    let told = draw(&drawing.to, &again, &Selection::default(), &options(true), &mut |_, _| {}).unwrap();
    assert_eq!((told.messages, &told.drawn), (22, &drawing.told.drawn));
}

#[test]
fn a_rate_takes_the_first_of_each_period_and_every_line() {
    let poses = (0..100).map(|number| sight("mapper.0", "pose", &pose(f64::from(number), 0.0, 0.0)));
    let lines = (0..100).map(|_| sight("output.0", "line", &line("again")));
    let both: Vec<Sight> = poses.zip(lines).flat_map(|(pose, line)| [pose, line]).collect();
    // Two seconds; the first period is the last quarter of one.
    let selection = Selection { period_ns: Some(500_000_000), ..Selection::default() };
    let drawing = Drawing::of(&both, &selection, false);
    assert_eq!(drawing.told.drawn["mapper.0/pose/transform"], 5);
    assert_eq!(drawing.told.drawn["output.0/line/log"], 100);
}

#[test]
fn nothing_long_is_in_a_file_twice() {
    let file = Image { pixels: Bytes(vec![7; (64 << 10) + 1]), ..Image::empty(2, 2, ImageFormat::Jpeg) };
    let sights = [
        sight("camera.0", "image", &long_picture().0),
        sight("camera.0", "image", &sights::picture()),
        sight("camera.1", "image", &file),
    ];
    let drawing = Drawing::of(&sights, &Selection::default(), true);
    assert_eq!(drawing.told.drawn, BTreeMap::from([("camera.0/image/image".into(), 2)]));
    assert_eq!(drawing.told.too_long, BTreeMap::from([("camera.1/image".into(), 1)]));
    assert_eq!(drawing.told.messages, 5);
    assert_eq!(reduced(&drawing.to), ["camera.0/image/image"]);
    let longest = |path: &Path| drawn_of(path).into_iter().map(|(.., data)| data.len()).max().unwrap();
    assert!((57_600..58_000).contains(&longest(&drawing.to)), "{}", longest(&drawing.to));
    let drawing = Drawing::all(&sights);
    assert_eq!(drawing.told.drawn.values().sum::<u64>(), 3);
    assert_eq!(reduced(&drawing.to), [""; 0]);
    assert!(longest(&drawing.to) > 640 * 480 * 3, "{}", longest(&drawing.to));
}

/// Topics that are told to be reduced.
fn reduced(path: &Path) -> Vec<String> {
    let channels = info(path).unwrap().channels.into_iter().filter(|channel| channel.is_reduced);
    channels.map(|channel| channel.topic.to_string()).collect()
}

#[test]
fn values_that_contradict_themselves_are_counted() {
    let short = Image { height_px: 3, ..sights::picture() };
    let cloud = rohrpost_modules::types::PointCloud { rows: 2, ..sights::cloud() };
    let mut cut_off = sight("laser.0", "scan", &scan(None));
    cut_off.3.pop();
    let sights = [
        sight("mapper.0", "pose", &pose(f64::NAN, 0.0, 0.0)),
        sight("camera.0", "image", &short),
        sight("depth.0", "points", &cloud),
        cut_off,
        sight("laser.0", "scan", &scan(Some(pose(0.0, f64::INFINITY, 0.0)))),
        sight("laser.0", "scan", &scan(Some(pose(5.0, 6.0, 0.0)))),
    ];
    let told = Drawing::all(&sights).told;
    let counts: Vec<(&str, u64)> = told.not_drawn.iter().map(|(topic, count)| (topic.as_str(), *count)).collect();
    assert_eq!(counts, [("camera.0/image", 1), ("depth.0/points", 1), ("laser.0/scan", 2), ("mapper.0/pose", 1)]);
    assert_eq!((told.messages, told.drawn["laser.0/scan/points"], told.drawn["world/transform"]), (2, 1, 1));
}

#[test]
fn what_cannot_be_drawn_is_explained_and_makes_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), "base", &[sight("motor.0", "speed", &7_u8)]);
    let to = folder.path().join("drawn.mcap");
    let drawn =
        |selection: &Selection, to: &Path| draw(&path, to, selection, &options(false), &mut |_, _| {}).unwrap_err();
    let error = drawn(&Selection::default(), &to);
    assert!(matches!(&error, DrawError::Nothing { there } if there == &["motor.0/speed"]), "{error}");
    let error = drawn(&Selection { names: vec!["laser.0".into()], ..Selection::default() }, &to);
    assert!(matches!(error, DrawError::Select(SelectError::NoName { .. })), "{error}");
    let scans = record(folder.path(), "scans", &[sight("laser.0", "scan", &scan(None))]);
    let error = draw(&scans, &path, &Selection::default(), &options(false), &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, DrawError::Rewrite(RewriteError::Exists(_))), "{error}");
    let bytes = std::fs::read(&scans).unwrap();
    std::fs::write(&scans, &bytes[..bytes.len() - 1]).unwrap();
    let error = draw(&scans, &to, &Selection::default(), &options(false), &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, DrawError::Select(SelectError::Read(ReadError::NotClosed { .. }))), "{error}");
    assert!(!to.exists());
}

/// Drawn messages of a file: topic, stamp, number and bytes.
fn drawn_of(path: &Path) -> Vec<(String, u64, u32, Vec<u8>)> {
    let mut reader = Reader::open(path).unwrap();
    let mut drawn = Vec::new();
    while let Some((channel, message)) = reader.next().unwrap() {
        if channel.is_drawn() {
            drawn.push((channel.topic.to_string(), message.stamp_ns, message.sequence, message.data.to_vec()));
        }
    }
    drawn
}

#[test]
fn what_is_drawn_while_it_is_recorded_is_what_is_drawn_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let path = record_drawn(folder.path(), 1, &sights());
    let to = folder.path().join("drawn.mcap");
    let classes = BTreeMap::from([(140, "pilot".to_owned())]);
    let options = DrawOptions { with_original: true, classes };
    draw(&path, &to, &Selection::default(), &options, &mut |_, _| {}).unwrap();
    let drawn = drawn_of(&path);
    assert_eq!(drawn.len(), 12);
    assert_eq!(drawn, drawn_of(&to));
    assert_eq!(topics(&path), topics(&to));
    assert_eq!(info(&path).unwrap().messages, 10 + 12, "and all that was recorded");
}

#[test]
fn what_is_drawn_while_it_is_recorded_is_sampled_and_reduced() {
    let folder = tempfile::tempdir().unwrap();
    // A hundredth of a second apart: 1.25 s after a full one, so periods of 0.1 s end behind the fifth.
    let mut all: Vec<Sight> = (0..12).map(|_| sight("mapper.0", "pose", &pose(1.0, 2.0, 0.5))).collect();
    all.extend((0..3).map(|_| sight("output.0", "line", &line("battery low"))));
    all.extend([0, 1].map(|_| sight("camera.0", "image", &long_picture().0)));
    all.extend([0, 1].map(|_| sight("depth.0", "points", &long_cloud().0)));
    let path = record_drawn(folder.path(), 100_000_000, &all);
    let drawn = drawn_of(&path);
    let of = |topic: &str| -> Vec<u32> {
        drawn.iter().filter(|(its, ..)| its == topic).map(|(_, _, number, _)| *number).collect()
    };
    assert_eq!(of("mapper.0/pose/pose"), [0, 5], "the first of each period");
    assert_eq!(of("output.0/line/log"), [12, 13, 14], "each line");
    assert_eq!(
        (of("camera.0/image/image"), of("depth.0/points/points")),
        (vec![15], vec![17]),
        "the first of a period"
    );
    assert_eq!(reduced(&path), ["camera.0/image/image", "depth.0/points/points"]);
    assert!(drawn.iter().all(|(.., data)| data.len() < 66_000), "a part of what is long");
    let told = info(&path).unwrap();
    let image = told.channels.iter().find(|channel| channel.topic == "camera.0/image").unwrap();
    assert_eq!((image.messages, told.lost), (2, 0));
}

#[test]
fn what_is_drawn_of_what_files_repeat_is_merged_once() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = Some(DrawnBeside { period_ns: 1, classes: BTreeMap::new() });
    let options = Options { drawn, ..Options::new(folder.path(), "base") };
    let all = sights();
    // The world is drawn of the odometry in the first file, and of the pose in the others.
    record_files(options, &[&all, &all[..1], &all[9..]]);
    let files = ["base-0001.mcap", "base-0002.mcap", "base-0003.mcap"].map(|name| folder.path().join(name));
    let told = files.each_ref().map(|path| info(path).unwrap());
    let messages: u64 = told.iter().map(|info| info.messages).sum();
    let worlds = |path: &Path| drawn_of(path).iter().filter(|(topic, ..)| topic == "world/transform").count();
    assert!(files.iter().all(|path| worlds(path) == 1) && told[1].repeated > 10, "{told:?}");
    let to = folder.path().join("all.merged");
    merge(&files, &to, &mut |_, _| {}).unwrap();
    let merged = info(&to).unwrap();
    assert_eq!((merged.messages, merged.repeated, worlds(&to)), (messages, 0, 1), "{merged:?}");
    let to = folder.path().join("rest.merged");
    merge(&files[1..], &to, &mut |_, _| {}).unwrap();
    assert_eq!((info(&to).unwrap().repeated, worlds(&to)), (told[1].repeated, 1));
}
