//! One value, drawn.

use super::clouds::{PackedPoints, of_cloud, of_scan};
use super::fields::ValueFields;
use super::kind::Kind;
use super::pictures::{Picture, of_picture};
use super::poses::PlanePose;
use super::proto::{CompressedImage, RawImage};
use super::proto::{FrameTransform, Log, LogLevel, PointCloud, PoseInFrame, PosesInFrame};
use crate::shape::Shape;
use prost::Message;
use prost_types::Timestamp;
use rohrpost_schema::Value;
use std::collections::BTreeMap;

/// The frame in which poses are given.
pub(crate) const WORLD: &str = "world";
/// Rerun's name for the frame in which it shows a scene, if nobody says otherwise.
const SHOWN: &str = "tf#/";

/// Whence a value comes.
pub(crate) struct Origin<'a> {
    /// The module: the frame of its pose, or of its picture.
    pub(crate) module: &'a str,
    /// The module on which scanners are.
    pub(crate) carrier: &'a str,
    pub(crate) stamp_ns: u64,
    /// Names of classes by their numbers.
    pub(crate) classes: &'a BTreeMap<u8, String>,
}

/// What is drawn of a value.
pub(crate) struct DrawnPart {
    pub(crate) kind: Kind,
    /// It has fewer pixels or points than the value.
    pub(crate) is_reduced: bool,
    pub(crate) data: Vec<u8>,
}

impl DrawnPart {
    fn whole(kind: Kind, message: &impl Message) -> Self {
        Self { kind, is_reduced: false, data: message.encode_to_vec() }
    }
}

/// Messages of a value, with at most so many bytes of pixels or points; none of a file that is longer. None if it
/// contradicts itself, or is nowhere.
pub(crate) fn draw_one(shape: Shape, value: Value, origin: &Origin<'_>, bytes_max: usize) -> Option<Vec<DrawnPart>> {
    let timestamp = origin.timestamp();
    Some(match shape {
        Shape::Pose => origin.pose(&PlanePose::of(value)?),
        Shape::Odometry => origin.pose(&PlanePose::of(ValueFields::of(value)?.take("pose")?)?),
        Shape::Path => {
            let Value::List(poses) = value else { return None };
            let poses = poses.into_iter().map(|pose| Some(PlanePose::of(pose)?.in_space())).collect::<Option<_>>()?;
            let drawn = PosesInFrame { timestamp, frame_id: WORLD.into(), poses };
            vec![DrawnPart::whole(Kind::Poses, &drawn)]
        }
        Shape::Scan => origin.points(of_scan(value)?, bytes_max),
        Shape::Points => origin.points(of_cloud(value)?, bytes_max),
        Shape::Picture => match of_picture(value, bytes_max)? {
            Picture::Raw { image, is_reduced } => {
                let drawn = RawImage { timestamp, frame_id: origin.module.into(), ..image };
                vec![DrawnPart { kind: Kind::Image, is_reduced, data: drawn.encode_to_vec() }]
            }
            Picture::File(image) if image.data.len() > bytes_max => Vec::new(),
            Picture::File(image) => {
                let drawn = CompressedImage { timestamp, frame_id: origin.module.into(), ..image };
                vec![DrawnPart::whole(Kind::Compressed, &drawn)]
            }
        },
        Shape::Line => {
            let mut line = ValueFields::of(value)?;
            let level = level(line.word("level")?).into();
            let name = origin.module_text(line.count("module")?);
            // Rerun shows the text alone.
            let message = format!("{name}: {}", line.text("text")?);
            let drawn = Log { timestamp, level, message, name };
            vec![DrawnPart::whole(Kind::Log, &drawn)]
        }
    })
}

/// That the world is where Rerun looks: without it, a scene is empty there until its user names the frame.
pub(crate) fn draw_world(stamp_ns: u64) -> Vec<u8> {
    let origin = Origin { module: WORLD, carrier: WORLD, stamp_ns, classes: &BTreeMap::new() };
    origin.transform(SHOWN, &PlanePose::ORIGIN).encode_to_vec()
}

impl Origin<'_> {
    fn timestamp(&self) -> Option<Timestamp> {
        const BILLION: u64 = 1_000_000_000;
        // 2^64 ns are fewer seconds than 2^63, and the rest fewer than 2^31.
        Some(Timestamp { seconds: (self.stamp_ns / BILLION) as i64, nanos: (self.stamp_ns % BILLION) as i32 })
    }

    fn transform(&self, parent: &str, pose: &PlanePose) -> FrameTransform {
        FrameTransform {
            timestamp: self.timestamp(),
            parent_frame_id: parent.into(),
            child_frame_id: self.module.into(),
            translation: Some(pose.translation()),
            rotation: Some(pose.rotation()),
        }
    }

    fn pose(&self, pose: &PlanePose) -> Vec<DrawnPart> {
        let transform = self.transform(WORLD, pose);
        let there = PoseInFrame { timestamp: self.timestamp(), frame_id: WORLD.into(), pose: Some(pose.in_space()) };
        vec![DrawnPart::whole(Kind::Transform, &transform), DrawnPart::whole(Kind::Pose, &there)]
    }

    /// Class and instance, or all by their numbers.
    fn module_text(&self, name: u32) -> String {
        let [system, class, instance, _] = name.to_be_bytes();
        self.classes.get(&class).map_or(format!("{system}.{class}.{instance}"), |class| format!("{class}.{instance}"))
    }

    fn points(&self, mut points: PackedPoints, bytes_max: usize) -> Vec<DrawnPart> {
        let is_reduced = points.reduce(bytes_max);
        let frame = if points.is_in_world { WORLD } else { self.carrier };
        // Points are in their frame itself; readers, such as Rerun, refuse a cloud that does not say so.
        let pose = Some(PlanePose::ORIGIN.in_space());
        let drawn = PointCloud { timestamp: self.timestamp(), frame_id: frame.into(), pose, ..points.cloud };
        vec![DrawnPart { kind: Kind::Points, is_reduced, data: drawn.encode_to_vec() }]
    }
}

fn level(word: &str) -> LogLevel {
    match word.to_ascii_lowercase().as_str() {
        "error" => LogLevel::Error,
        "warn" => LogLevel::Warning,
        "info" => LogLevel::Info,
        "debug" | "trace" => LogLevel::Debug,
        _ => LogLevel::Unknown,
    }
}
