//! A recording with one of each that is drawn, of the types that modules have.

use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::output::OutputLine;
use rohrpost_modules::types::{Bytes, Image, ImageFormat, LaserScan, Odometry, PointCloud, PointFormat, Pose, Twist};
use rohrpost_recording::{ChannelSpec, DrawnBeside, Message, Options, Session, Writer};
use rohrpost_schema::{Data, Type};
use std::collections::BTreeMap;
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// The stamp of the first message.
pub(crate) const STAMP_NS: u64 = 1_700_000_000_250_000_000;

/// A value of a channel: name, item, type and bytes.
pub(crate) type Sight = (&'static str, &'static str, Type, Vec<u8>);

pub(crate) fn sight<T: Data>(name: &'static str, item: &'static str, value: &T) -> Sight {
    (name, item, T::schema(), postcard::to_stdvec(value).unwrap())
}

pub(crate) fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
    Pose { x_m, y_m, heading_rad }
}

/// Beams forward, left, back and right; only the first hits something.
pub(crate) fn scan(pose: Option<Pose>) -> LaserScan {
    let ranges_m = vec![2.0, f32::NAN, 30.0, f32::INFINITY];
    LaserScan { start_rad: 0.0, step_rad: FRAC_PI_2, range_max_m: 10.0, ranges_m, pose }
}

/// Two by two pixels, two bytes behind each row.
pub(crate) fn picture() -> Image {
    let pixels = Bytes(vec![10, 20, 30, 40, 50, 60, 0, 0, 70, 80, 90, 100, 110, 120, 0, 0]);
    Image { row_bytes: 8, pixels, ..Image::empty(2, 2, ImageFormat::Rgb8) }
}

/// A red point, and a place where nothing came back.
pub(crate) fn cloud() -> PointCloud {
    let point = |x_m: f32, y_m: f32, z_m: f32, rgb: [u8; 4]| {
        [x_m, y_m, z_m].iter().flat_map(|metres| metres.to_le_bytes()).chain(rgb).collect::<Vec<u8>>()
    };
    let points = [point(1.0, 2.0, 3.0, [255, 0, 0, 0]), point(f32::NAN, f32::NAN, f32::NAN, [0; 4])].concat();
    PointCloud { points: Bytes(points), ..PointCloud::empty(2, 1, PointFormat::XyzRgb) }
}

/// Of 640 by 480 pixels, which tell their column and row; and those of every fourth of every fourth row, which are as
/// many as fit in 64 KiB.
pub(crate) fn long_picture() -> (Image, Vec<u8>) {
    let pixels = |every: usize| {
        let row = move |y: u32| (0..640_u32).step_by(every).flat_map(move |x| [x as u8, y as u8, (x >> 8) as u8]);
        (0..480).step_by(every).flat_map(row).collect::<Vec<u8>>()
    };
    (Image { pixels: Bytes(pixels(1)), ..Image::empty(640, 480, ImageFormat::Rgb8) }, pixels(4))
}

/// Of ten thousand points, and the bytes of every second, which are as many as fit in 64 KiB.
pub(crate) fn long_cloud() -> (PointCloud, Vec<u8>) {
    let points = |every: usize| {
        let point = |number: u32| [number as f32, 1.0, -1.0].map(f32::to_le_bytes).concat();
        (0..10_000).step_by(every).flat_map(point).collect::<Vec<u8>>()
    };
    (PointCloud { points: Bytes(points(1)), ..PointCloud::empty(10_000, 1, PointFormat::Xyz) }, points(2))
}

pub(crate) fn line(text: &str) -> OutputLine {
    let module = u32::from_be_bytes([1, 140, 3, 0]);
    let (lost, suppressed) = (0, 0);
    OutputLine { time_ns: STAMP_NS, module, level: OutputLevel::Warn, lost, suppressed, errno: None, text: text.into() }
}

/// One of each, and one that is not drawn.
pub(crate) fn sights() -> Vec<Sight> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let odometry = Odometry { pose: pose(1.5, -2.0, quarter), twist: Twist::default() };
    let jpeg = Image { pixels: Bytes(b"a file".to_vec()), ..Image::empty(2, 2, ImageFormat::Jpeg) };
    vec![
        sight("odometry.0", "odometry", &odometry),
        sight("mapper.0", "pose", &pose(3.0, 4.0, 0.0)),
        sight("pilot.0", "path", &vec![pose(0.0, 0.0, 0.0), pose(1.0, 0.5, quarter)]),
        sight("laser.0", "scan", &scan(None)),
        sight("laser.1", "scan", &scan(Some(pose(5.0, 6.0, quarter)))),
        sight("depth.0", "points", &cloud()),
        sight("camera.0", "image", &picture()),
        sight("camera.1", "image", &jpeg),
        sight("output.0", "line", &line("battery low")),
        sight("motor.0", "speed", &7_u8),
    ]
}

/// Records these in turn, a hundredth of a second apart.
pub(crate) fn record(folder: &Path, stem: &str, sights: &[Sight]) -> PathBuf {
    record_with(Options::new(folder, stem), sights);
    folder.join(format!("{stem}-0001.mcap"))
}

/// The same with other options.
pub(crate) fn record_with(options: Options, sights: &[Sight]) {
    record_files(options, &[sights]);
}

/// A recording that draws what it records; its file.
pub(crate) fn record_drawn(folder: &Path, period_ns: u64, sights: &[Sight]) -> PathBuf {
    let drawn = Some(DrawnBeside { period_ns, classes: BTreeMap::from([(140, "pilot".to_owned())]) });
    record_with(Options { drawn, ..Options::new(folder, "beside") }, sights);
    folder.join("beside-0001.mcap")
}

/// The same, each of these in a file of its own.
pub(crate) fn record_files(options: Options, files: &[&[Sight]]) {
    let session = Session { node: "base".into(), ..Session::default() };
    let mut writer = Writer::start(Options { leave_bytes: 0, ..options }, session).unwrap();
    let sights = files.iter().flat_map(|file| file.iter().enumerate());
    for (number, (at, (name, item, ty, data))) in (0_u32..).zip(sights) {
        if number > 0 && at == 0 {
            writer.rotate().unwrap();
        }
        let channel = writer.channel(&ChannelSpec { name, item, ty, texts: BTreeMap::new() }).unwrap();
        let stamp_ns = STAMP_NS + u64::from(number) * 10_000_000;
        let message = Message { arrival_ns: stamp_ns + 1_000, stamp_ns, epoch: 1, sequence: number, data };
        writer.write(channel, &message).unwrap();
    }
    writer.finish().1.unwrap();
}
