//! Typed values: postcard and the walker must agree on every byte.

use super::{check_cuts, check_value, map, same, text, through_json, variant};
use crate::{Bytes, Data, Schema, Type, Value, decode, encode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
struct Marker;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
struct Meters(f32);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
struct Pair(i16, char);

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema)]
enum Lamp {
    Off,
    #[serde(rename = "on")]
    On,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
enum Order {
    Stop,
    Go(f64),
    Hold(Option<u8>),
    Turn(i32, bool),
    Drive { speed_m_s: f64, until: Option<Lamp> },
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
struct Pen<T> {
    inside: T,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct Pose {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) heading_rad: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct Twist {
    pub(super) speed_m_s: f64,
    pub(super) turn_rate_rad_s: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct Odometry {
    pub(super) pose: Pose,
    pub(super) twist: Twist,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct LaserScan {
    pub(super) angle_min_rad: f32,
    pub(super) angle_step_rad: f32,
    pub(super) range_max_m: f32,
    pub(super) ranges_m: Vec<f32>,
    pub(super) pose: Option<Pose>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
struct Zoo {
    signed: (i8, i16, i32, i64, i128),
    unsigned: (u8, u16, u32, u64),
    huge: u128,
    floats: (f32, f64),
    small: [f64; 3],
    flag: bool,
    letter: char,
    name: String,
    nothing: (),
    marker: Marker,
    distance: Meters,
    pair: Pair,
    maybe: Option<u8>,
    nested: [Option<Option<u8>>; 3],
    some_nothing: [Option<()>; 2],
    orders: Vec<Order>,
    bytes: Vec<u8>,
    blob: Bytes,
    by_name: BTreeMap<String, u16>,
    by_number: BTreeMap<i64, char>,
    by_lamp: BTreeMap<Lamp, bool>,
    by_place: BTreeMap<(i8, i8), f32>,
    result: Result<u8, String>,
    units: Vec<()>,
    pen: Pen<Box<Lamp>>,
}

fn zoo() -> Zoo {
    Zoo {
        signed: (i8::MIN, i16::MIN, i32::MIN, i64::MIN, i128::MIN),
        unsigned: (u8::MAX, u16::MAX, u32::MAX, u64::MAX),
        huge: u128::MAX,
        floats: (1.2, f64::NAN),
        small: [f64::INFINITY, f64::NEG_INFINITY, -0.0],
        flag: true,
        letter: '🦀',
        name: "Rohr\u{1b}post".into(),
        nothing: (),
        marker: Marker,
        distance: Meters(f32::NAN),
        pair: Pair(-300, 'ß'),
        maybe: Some(3),
        nested: [None, Some(None), Some(Some(9))],
        some_nothing: [None, Some(())],
        orders: vec![
            Order::Stop,
            Order::Go(2.5),
            Order::Hold(None),
            Order::Hold(Some(1)),
            Order::Turn(-1, true),
            Order::Drive { speed_m_s: 0.1, until: Some(Lamp::On) },
        ],
        bytes: vec![0, 128, 255],
        blob: vec![1, 2].into(),
        by_name: [("a".into(), 1), ("".into(), 2)].into(),
        by_number: [(-5, 'x')].into(),
        by_lamp: [(Lamp::Off, false), (Lamp::On, true)].into(),
        by_place: [((-1, 1), 0.3)].into(),
        result: Ok(200),
        units: vec![(); 3],
        pen: Pen { inside: Box::new(Lamp::On) },
    }
}

fn zoo_value() -> Value {
    map([
        (
            "signed",
            Value::List(vec![
                Value::I(-128),
                Value::I(-32_768),
                Value::I(-2_147_483_648),
                Value::I(i128::from(i64::MIN)),
                Value::I(i128::MIN),
            ]),
        ),
        ("unsigned", Value::List([255, 65_535, u128::from(u32::MAX), u128::from(u64::MAX)].map(Value::U).into())),
        ("huge", Value::U(u128::MAX)),
        ("floats", Value::List(vec![Value::F(1.2), Value::F(f64::NAN)])),
        ("small", Value::List([f64::INFINITY, f64::NEG_INFINITY, -0.0].map(Value::F).into())),
        ("flag", Value::Bool(true)),
        ("letter", Value::Char('🦀')),
        ("name", text("Rohr\u{1b}post")),
        ("nothing", Value::Null),
        ("marker", Value::Null),
        ("distance", Value::F(f64::NAN)),
        ("pair", Value::List(vec![Value::I(-300), Value::Char('ß')])),
        ("maybe", Value::U(3)),
        ("nested", Value::List(vec![Value::Null, variant("Some", Value::Null), variant("Some", Value::U(9))])),
        ("some_nothing", Value::List(vec![Value::Null, variant("Some", Value::Null)])),
        (
            "orders",
            Value::List(vec![
                variant("Stop", Value::Null),
                variant("Go", Value::F(2.5)),
                variant("Hold", Value::Null),
                variant("Hold", Value::U(1)),
                variant("Turn", Value::List(vec![Value::I(-1), Value::Bool(true)])),
                variant("Drive", map([("speed_m_s", Value::F(0.1)), ("until", variant("on", Value::Null))])),
            ]),
        ),
        ("bytes", Value::Bytes(vec![0, 128, 255])),
        ("blob", Value::Bytes(vec![1, 2])),
        ("by_name", map([("", Value::U(2)), ("a", Value::U(1))])),
        ("by_number", map([("-5", Value::Char('x'))])),
        ("by_lamp", map([("Off", Value::Bool(false)), ("on", Value::Bool(true))])),
        ("by_place", Value::List(vec![Value::List(vec![Value::List(vec![Value::I(-1), Value::I(1)]), Value::F(0.3)])])),
        ("result", variant("Ok", Value::U(200))),
        ("units", Value::List(vec![Value::Null; 3])),
        ("pen", map([("inside", variant("on", Value::Null))])),
    ])
}

/// Postcard's bytes of `typed`, once the walker agreed with them.
fn check_typed<T: Data>(typed: &T) -> (Type, Vec<u8>) {
    let (ty, bytes) = (T::schema(), postcard::to_stdvec(typed).unwrap());
    let value = decode(&ty, &bytes).unwrap();
    assert_eq!(check_value(&ty, &value), bytes);
    assert_eq!(encode(&ty, &through_json(&value)).unwrap(), bytes);
    check_cuts(&ty, &bytes);
    (ty, bytes)
}

#[test]
fn the_zoo_decodes_to_the_documented_forms() {
    let (ty, bytes) = check_typed(&zoo());
    let value = decode(&ty, &bytes).unwrap();
    assert!(same(&value, &zoo_value()), "{value:#?}");
    let again: Zoo = postcard::from_bytes(&encode(&ty, &value).unwrap()).unwrap();
    assert_eq!(format!("{again:?}"), format!("{:?}", zoo()), "compared as text, where NaN equals NaN");
}

#[test]
fn standard_types_have_the_bytes_of_postcard() {
    let pose = Pose { x_m: 1.25, y_m: -0.0, heading_rad: 1e-9 };
    check_typed(&pose);
    check_typed(&Twist { speed_m_s: f64::NAN, turn_rate_rad_s: f64::NEG_INFINITY });
    check_typed(&Odometry { pose, twist: Twist::default() });
    let ranges_m = vec![1.2, f32::INFINITY, f32::NAN, f32::MIN_POSITIVE, f32::MAX, 16_777_217.0, 0.1 + 0.2];
    check_typed(&LaserScan { ranges_m, pose: Some(pose), ..LaserScan::default() });
    check_typed(&());
}

#[test]
fn json_is_that_of_serde_json() {
    fn check<T: Data>(typed: &T) {
        let value = decode(&T::schema(), &postcard::to_stdvec(typed).unwrap()).unwrap();
        assert_eq!(serde_json::to_value(&value).unwrap(), serde_json::to_value(typed).unwrap());
    }
    check(&Odometry::default());
    let mut orders = zoo().orders;
    orders.retain(|order| *order != Order::Hold(None)); // Ours is `"Hold"`, as a payload of null is none.
    check(&orders);
    check(&(zoo().by_name, zoo().by_number, zoo().by_lamp));
    check(&(Ok::<u8, String>(5), Err::<u8, String>("no".into()), Some('x'), None::<u8>, (1i8,)));
}
