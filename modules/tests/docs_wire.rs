//! The examples of `docs/src/wire.md` are what the code writes.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_mailbox::{HEAD_BYTES, Head, Name, Options, Priority, Type};
use rohrpost_modules::call::{CallEnvelope, Fault, ReplyEnvelope};
use rohrpost_modules::common::{self, DataHead, OutputLevel, SetParameters};
use rohrpost_modules::interfaces::{DriveError, MotorInterface};
use rohrpost_modules::output::{LINES, OutputLine};
use rohrpost_modules::parameter::Refusal;
use rohrpost_modules::types::{
    Bytes, Image, ImageFormat, LaserScan, OccupancyGrid, Odometry, PointCloud, PointFormat, Pose, Twist,
};
use rohrpost_schema::{Schema, Type as Described};
use serde::Serialize;
use std::fmt::Display;

const PAGE: &str = include_str!("../../docs/src/wire.md");

/// The bytes of a block: each line begins with digits, two a byte, then two spaces and words.
fn block(name: &str) -> Vec<u8> {
    let fence = format!("\n```hex {name}\n");
    let text = PAGE.split(&fence).nth(1).unwrap_or_else(|| panic!("no ```hex {name}")).split("\n```").next().unwrap();
    let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap_or_default().as_bytes().chunks(2));
    let byte = |pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16);
    pairs.map(|pair| byte(pair).unwrap_or_else(|_| panic!("{name}: `{pair:?}`"))).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x} ")).collect()
}

fn check(name: &str, head: Head, front: &[u8], value: &[u8]) {
    let len = (front.len() + value.len()) as u16;
    let head = Head { len, ..head };
    let (there, body) = (block(name), [front, value].concat());
    assert_eq!(Head::from_bytes(&there), Ok(head), "{name}: its head reads otherwise");
    // The bytes as a little-endian computer writes them, whatever this one is.
    if cfg!(target_endian = "little") {
        assert_eq!(hex(&there[..HEAD_BYTES]), hex(&head.to_bytes()), "{name}: left the page, right the code");
    }
    assert_eq!(hex(&there[HEAD_BYTES..]), hex(&body), "{name}: left the page, right the code");
}

const PILOT: Name = Name::new(1, 140, 0, 1);
const MOTOR: Name = Name::new(1, 200, 0, 0);

#[test]
fn a_command_has_the_documented_bytes() {
    let interface = MotorInterface::hash();
    let call = CallEnvelope { interface, incarnation: 1_234_567_890, sequence: 7, valid_for_us: 200_000, age_us: 0 };
    let head =
        Head { to: MOTOR, from: PILOT, kind: Type::command(16), id: 7, priority: Priority(140), ..Head::default() };
    check("command", head, &call.to_bytes(), &postcard::to_stdvec(&(0.3f64, 0.5f64)).unwrap());
}

#[test]
fn a_reply_has_the_documented_bytes() {
    let envelope = ReplyEnvelope { incarnation: 1_234_567_890, sequence: 7 };
    let head =
        Head { to: PILOT, from: MOTOR, kind: Type::reply(16), id: 7, priority: Priority(140), ..Head::default() };
    check("reply", head, &envelope.to_bytes(), &postcard::to_stdvec(&Ok::<(), DriveError>(())).unwrap());
}

#[test]
fn setting_a_parameter_has_the_documented_bytes() {
    let tool = Name::new(1, 16, 1, 1);
    let call = CallEnvelope {
        interface: common::HASH,
        incarnation: 1_234_567_890,
        sequence: 7,
        valid_for_us: 1_000_000,
        age_us: 0,
    };
    let kind = Type::command(common::SET_PARAMETERS);
    let head = Head { to: PILOT.with_local(0), from: tool, kind, id: 7, priority: Priority(16), ..Head::default() };
    let values = vec![("cruise-m-s".to_owned(), postcard::to_stdvec(&0.4f64).unwrap())];
    let wish = SetParameters { values, only_check: false };
    check("set", head, &call.to_bytes(), &postcard::to_stdvec(&wish).unwrap());
}

#[test]
fn refusals_have_the_documented_numbers() {
    let (name, text) = (String::new(), String::new());
    let refusals = [
        Refusal::NoParameters,
        Refusal::Unknown { name: name.clone(), known: text.clone() },
        Refusal::Twice(name.clone()),
        Refusal::Type { name: name.clone(), text: text.clone() },
        Refusal::Range { name, value: text.clone(), range: text.clone() },
        Refusal::Module(text),
    ];
    check_numbers("| | refusal |", &refusals);
}

#[test]
fn a_line_of_output_has_the_documented_bytes() {
    let line = OutputLine {
        time_ns: 123_456_789,
        module: MOTOR.raw(),
        level: OutputLevel::Info,
        lost: 0,
        suppressed: 0,
        errno: None,
        text: "is on".into(),
    };
    let data = DataHead { stamp_ns: line.time_ns, sequence: 2, missed: line.lost, incarnation: 0 };
    let (kind, priority, options) = (Type::data(1), Priority(32), Options::STAMPED);
    let head = Head { to: Name::new(1, 32, 0, LINES), from: MOTOR, kind, priority, options, ..Head::default() };
    check("line", head, &data.to_bytes(), &postcard::to_stdvec(&line).unwrap());
}

#[test]
fn faults_have_the_documented_numbers() {
    let text = String::new;
    let faults = [
        Fault::ModuleOff,
        Fault::ModuleError(text()),
        Fault::Interrupted,
        Fault::InterfaceDiffers { server: 0 },
        Fault::Unknown(0),
        Fault::Arguments(text()),
        Fault::Expired,
        Fault::Busy,
        Fault::NothingYet,
        Fault::TooLarge(0),
        Fault::NoMailbox,
        Fault::MailboxFull,
        Fault::CommandTooLarge(0),
        Fault::NoRoute,
        Fault::NodeSilent { node: text() },
        Fault::NodeDeaf { node: text() },
        Fault::NodeRefuses { node: text(), why: text() },
        Fault::RouterFull,
        Fault::Delayed,
        Fault::NotAllowed { node: text(), rule: text() },
        Fault::EarlierIncarnation,
    ];
    check_numbers("| | fault |", &faults);
}

#[test]
fn images_and_points_have_the_documented_bytes() {
    let pixels = Bytes(vec![0, 128, 255, 0, 255, 128, 0, 0]);
    let image = Image { width_px: 3, height_px: 2, row_bytes: 4, format: ImageFormat::Gray8, pixels };
    image.check().unwrap();
    assert_eq!(hex(&block("image")), hex(&postcard::to_stdvec(&image).unwrap()));
    let place = [1.5f32, 0.0, -0.5].into_iter().flat_map(f32::to_le_bytes);
    let points = Bytes(place.chain([255, 0, 0, 0]).collect());
    let cloud = PointCloud { columns: 1, rows: 1, format: PointFormat::XyzRgb, points };
    cloud.check().unwrap();
    assert_eq!(hex(&block("points")), hex(&postcard::to_stdvec(&cloud).unwrap()));
}

/// Numbers and names in the first columns of a table.
fn rows(head: &str) -> Vec<(String, String)> {
    let (table, _) = PAGE.split(head).nth(1).unwrap().split_once("\n\n").unwrap();
    let cells = |line: &str| -> Vec<String> { line.split('|').map(|cell| cell.trim().to_owned()).collect() };
    table.lines().skip(2).map(cells).map(|cells| (cells[1].clone(), cells[2].clone())).collect()
}

/// All there are in a table, in its order.
fn check_numbers<T: Serialize + Display>(head: &str, all: &[T]) {
    assert_eq!(rows(head).len(), all.len());
    for (number, one) in all.iter().enumerate() {
        assert_eq!(usize::from(postcard::to_stdvec(one).unwrap()[0]), number, "{one}");
    }
}

#[test]
fn formats_of_pixels_and_points_have_the_documented_numbers() {
    for (head, described) in [
        ("| | format | bytes of a pixel |", ImageFormat::schema()),
        ("| | format | bytes of a point |", PointFormat::schema()),
    ] {
        let Described::Enum { variants, .. } = described else { panic!("{head} is of an enum") };
        let expected = variants.into_iter().enumerate().map(|(number, variant)| (number.to_string(), variant.name));
        assert_eq!(rows(head), expected.collect::<Vec<_>>());
    }
}

#[test]
fn standard_types_have_the_documented_names() {
    let described = [
        Pose::schema(),
        Twist::schema(),
        Odometry::schema(),
        LaserScan::schema(),
        OccupancyGrid::schema(),
        Image::<Bytes>::schema(),
        PointCloud::<Bytes>::schema(),
    ];
    let names = described.into_iter().map(|described| match described {
        Described::Struct(named) => format!("`{}`", named.name),
        other => panic!("{other:?} is no struct"),
    });
    let documented = rows("| name | what it is |").into_iter().map(|(name, _)| name);
    assert_eq!(documented.collect::<Vec<_>>(), names.collect::<Vec<_>>());
}
