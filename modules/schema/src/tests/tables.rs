//! What is refused and how it says so; what is understood all the same; how things read.

use super::zoo::{LaserScan, Odometry, Pose, Twist};
use super::{error_text, map, numbers, text, variant};
use crate::{DEPTH_MAX, EMPTY_MAX, Schema, Type, Value, decode, describe_type, encode, parse_argument};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Serialize, Deserialize, Schema)]
enum Mode {
    Stop,
    TurnLeft,
    Go { speed_m_s: f64, limit: Option<u8> },
    Set(f32),
}

#[derive(Serialize, Deserialize, Schema)]
enum Switch {
    On,
    Off,
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn damaged_bytes_name_the_place() {
    let scan = postcard::to_stdvec(&LaserScan { ranges_m: vec![1.0; 5], ..LaserScan::default() }).unwrap();
    let vec_f64 = Vec::<f64>::schema;
    for (ty, bytes, expected) in [
        (LaserScan::schema(), &scan[..12 + 1 + 4 * 3 + 2], "ranges_m[3]: 2 bytes missing"),
        (Odometry::schema(), &[0; 36], "twist.turn_rate_rad_s: 4 bytes missing"),
        (vec_f64(), &[0xff; 10], "a number that does not fit 64 bits"),
        (vec_f64(), &[0xff, 0xff, 0xff, 0x7f, 1], "claims 268435455 elements, but only 1 byte left"),
        (vec_f64(), &[1, 0], "[0]: 7 bytes missing"),
        (Vec::<Vec<u8>>::schema(), &[2, 1, 7, 3, 1], "[1]: 2 bytes missing"),
        (bool::schema(), &[2], "expected a byte 0 or 1, got 2"),
        (u16::schema(), &[0xff, 0xff, 4], "a number that does not fit 16 bits"),
        (String::schema(), &[1, 0xff], "text that is not UTF-8"),
        (char::schema(), &[2, b'a', b'b'], "not exactly one character"),
        (char::schema(), &[0], "not exactly one character"),
        (Mode::schema(), &[9], "variant number 9, but only 4 variants known"),
        (Mode::schema(), &[2, 0], "Go.speed_m_s: 7 bytes missing"),
        (BTreeMap::<u8, bool>::schema(), &[1, 7, 3], "7: expected a byte 0 or 1, got 3"),
        (<()>::schema(), &[0, 0], "2 bytes too many"),
    ] {
        assert_eq!(error_text(decode(&ty, bytes)), expected);
    }
}

#[test]
fn elements_without_bytes_are_bounded() {
    let varint = |number| postcard::to_stdvec::<u64>(&number).unwrap();
    let expected = format!("more than {EMPTY_MAX} values that take no bytes");
    for (ty, length, fits) in [
        (Vec::<()>::schema(), EMPTY_MAX as u64, true),
        (Vec::<()>::schema(), EMPTY_MAX as u64 + 1, false),
        (Vec::<()>::schema(), u64::MAX, false),
        (Vec::<((), [(); 3])>::schema(), EMPTY_MAX as u64 / 6, true),
        (Vec::<((), [(); 3])>::schema(), EMPTY_MAX as u64 / 5, false),
    ] {
        match decode(&ty, &varint(length)) {
            Ok(_) => assert!(fits, "{length} of {ty:?}"),
            Err(error) => assert!(!fits && error.to_string().ends_with(&expected), "{length} of {ty:?}: {error}"),
        }
    }
    let many_lists = [varint(3), varint(30_000), varint(30_000), varint(30_000)].concat();
    assert_eq!(error_text(decode(&Vec::<Vec<()>>::schema(), &many_lists)), format!("[2]: {expected}"));
}

#[test]
fn nesting_is_bounded() {
    let nest = |levels| (0..levels).fold(Type::Unit, |ty, _| Type::Tuple(vec![ty]));
    let (value, hostile) = ((0..DEPTH_MAX).fold(Value::Null, |value, _| Value::List(vec![value])), nest(2 * DEPTH_MAX));
    assert!(decode(&nest(DEPTH_MAX - 1), &[]).is_ok());
    assert!(error_text(decode(&nest(DEPTH_MAX), &[])).ends_with("nested more than 128 deep"));
    assert!(error_text(encode(&nest(DEPTH_MAX), &value)).ends_with("nested more than 128 deep"));
    assert!(decode(&Type::list(hostile.clone()), &[1, 0]).is_err());
    assert_eq!(describe_type(&hostile), "[[[[…]]]]");
}

#[test]
fn what_people_and_json_write_is_understood() {
    for (ty, given, meant) in [
        (u8::schema(), "5", Value::U(5)),
        (i8::schema(), "5", Value::I(5)),
        (u32::schema(), "1e3", Value::U(1000)),
        (u128::schema(), r#""340282366920938463463374607431768211455""#, Value::U(u128::MAX)),
        (f32::schema(), "3", Value::F(3.0)),
        (f64::schema(), r#""-inf""#, Value::F(f64::NEG_INFINITY)),
        (char::schema(), r#""x""#, Value::Char('x')),
        (Vec::<u8>::schema(), "[1, 2]", Value::Bytes(vec![1, 2])),
        (Mode::schema(), r#""Stop""#, variant("Stop", Value::Null)),
        (Mode::schema(), r#""turn-left""#, variant("TurnLeft", Value::Null)),
        (Mode::schema(), r#"{"Stop": null}"#, variant("Stop", Value::Null)),
        (Mode::schema(), r#"{"set": 0.1}"#, variant("Set", Value::F(0.1))),
        (
            Mode::schema(),
            r#"{"go": {"speed_m_s": 1}}"#,
            variant("Go", map([("speed_m_s", Value::F(1.0)), ("limit", Value::Null)])),
        ),
        (
            Twist::schema(),
            r#"{"turn_rate_rad_s": 1, "speed_m_s": 2}"#,
            map([("speed_m_s", Value::F(2.0)), ("turn_rate_rad_s", Value::F(1.0))]),
        ),
        (BTreeMap::<u8, bool>::schema(), r#"[[7, true]]"#, map([("7", Value::Bool(true))])),
    ] {
        assert_eq!(decode(&ty, &encode(&ty, &json(given)).unwrap()).unwrap(), meant, "{given}");
    }
}

#[test]
fn wrong_values_name_the_place_and_what_was_expected() {
    for (ty, given, expected) in [
        (Odometry::schema(), r#"{"twist": {}}"#, "pose: not given; expected {x_m: f64, y_m: f64, heading_rad: f64}"),
        (Pose::schema(), r#"{"x_m": 0, "y_m": "wide", "heading_rad": 0}"#, "y_m: expected a number (f64), got `wide`"),
        (
            Twist::schema(),
            r#"{"speed_m_s": 0, "turn_rate_rad_s": 0, "sped": 1}"#,
            "sped: no such field; there is speed_m_s, turn_rate_rad_s",
        ),
        (Twist::schema(), r#"{"speed_m_s": 0, "turn_rate_rad_s": 0, "speed_m_s": 1}"#, "speed_m_s: given twice"),
        (Vec::<u8>::schema(), "[1, 256]", "[1]: 256 is out of range: u8 is 0 to 255"),
        (Vec::<i8>::schema(), "[-129]", "[0]: -129 is out of range: i8 is -128 to 127"),
        (u8::schema(), "-1", "-1 is out of range: u8 is 0 to 255"),
        (u8::schema(), "0.5", "expected a whole number (u8), got `0.5`"),
        (f32::schema(), "1e39", "1e39 is out of range: f32 ends at 3.4028234663852886e38"),
        (bool::schema(), "1", "expected true or false, got `1`"),
        (<(u8, u8)>::schema(), "[1]", "expected 2 elements, got 1"),
        (Option::<Option<u8>>::schema(), "5", "expected {Some: u8?}?, got `5`"),
        (BTreeMap::<u8, bool>::schema(), r#"{"x": true}"#, "x: expected a whole number (u8), got `x`"),
        (Switch::schema(), r#""o""#, "expected On|Off, got `o`"),
        (
            Mode::schema(),
            r#"{"Go": 5}"#,
            "expected Stop|TurnLeft|{Go: {speed_m_s: f64, limit: u8?}}|{Set: f32}, got `{Go: 5}`",
        ),
        (Mode::schema(), r#"{"Go": {}}"#, "Go.speed_m_s: not given; expected a number (f64)"),
    ] {
        assert_eq!(error_text(encode(&ty, &json(given))), expected, "{given}");
    }
}

#[test]
fn arguments_are_plain_words() {
    for (ty, word, meant) in [
        (f64::schema(), "-0.5", Value::F(-0.5)),
        (f64::schema(), "1e3", Value::F(1000.0)),
        (f64::schema(), "0x10", Value::F(16.0)),
        (f32::schema(), "inf", Value::F(f64::INFINITY)),
        (i16::schema(), "-0x10", Value::I(-16)),
        (u64::schema(), "+7", Value::U(7)),
        (u128::schema(), "340282366920938463463374607431768211455", Value::U(u128::MAX)),
        (bool::schema(), "true", Value::Bool(true)),
        (char::schema(), "7", Value::Char('7')),
        (String::schema(), "", text("")),
        (String::schema(), "null", text("null")),
        (Option::<String>::schema(), "null", Value::Null),
        (Option::<String>::schema(), "word", text("word")),
        (Option::<Option<u8>>::schema(), "1", variant("Some", Value::U(1))),
        (<()>::schema(), "null", Value::Null),
        (Switch::schema(), "on", variant("On", Value::Null)),
        (Mode::schema(), "turn_left", variant("TurnLeft", Value::Null)),
    ] {
        assert_eq!(parse_argument(&ty, word).unwrap(), meant, "{word}");
    }
    for (ty, word, expected) in [
        (f64::schema(), "fast", "expected a number (f64), got `fast`"),
        (f64::schema(), "1e999", "1e999 is out of range: f64 ends at 1.7976931348623157e308"),
        (u8::schema(), "0x", "expected a whole number (u8), got `0x`"),
        (u8::schema(), "", "expected a whole number (u8), got ``"),
        (bool::schema(), "yes", "expected true or false, got `yes`"),
        (char::schema(), "ab", "expected one character, got `ab`"),
        (Switch::schema(), "onn", "expected On|Off, got `onn`"),
        (Twist::schema(), "1", "expected JSON {speed_m_s: f64, turn_rate_rad_s: f64}, got `1`"),
        (Mode::schema(), "set", "expected JSON Stop|TurnLeft|{Go: {speed_m_s: f64, limit: u8?}}|{Set: f32}, got `set`"),
        (u8::schema(), "\u{1b}[31m", "expected a whole number (u8), got `\\u{1b}[31m`"),
    ] {
        assert_eq!(error_text(parse_argument(&ty, word)), expected);
    }
}

#[test]
fn types_and_values_read_well() {
    for (ty, expected) in [
        (Vec::<f32>::schema(), "[f32]"),
        (<[f64; 3]>::schema(), "[f64; 3]"),
        (<(u8, String)>::schema(), "[u8, text]"),
        (Option::<Switch>::schema(), "(On|Off)?"),
        (BTreeMap::<String, u8>::schema(), "{<text>: u8}"),
        (BTreeMap::<(u8, u8), u8>::schema(), "[[[u8; 2], u8]]"),
        (
            Odometry::schema(),
            "{pose: {x_m: f64, y_m: f64, heading_rad: f64}, twist: {speed_m_s: f64, turn_rate_rad_s: f64}}",
        ),
    ] {
        assert_eq!(describe_type(&ty), expected);
    }
    let value = map([
        ("pose", map([("x_m", Value::F(1.25)), ("y_m", Value::F(0.0))])),
        ("ranges_m", Value::List((0..360).map(|i| Value::F(1.2 + f64::from(i))).collect())),
        ("mode", variant("Go", map([("speed_m_s", Value::F(1e-9))]))),
        ("lamp", variant("on", Value::Null)),
        ("odd name", Value::List(vec![text("a\n"), Value::Char('b'), Value::F(f64::NAN), Value::Bool(true)])),
    ]);
    let start = "{pose: {x_m: 1.25, y_m: 0}, ranges_m: [1.2, 2.2, … 358 more], mode: Go({speed_m_s: 1e-9}), lamp: on, ";
    assert_eq!(value.display(2).to_string(), format!("{start}\"odd name\": [\"a\\n\", 'b', … 2 more]}}"));
    let plotted = numbers(&value, 2);
    let paths: Vec<_> = plotted.iter().map(|(path, _)| path.as_str()).collect();
    assert_eq!(paths, ["pose.x_m", "pose.y_m", "ranges_m[0]", "ranges_m[1]", "mode.Go.speed_m_s"]);
}

/// No program has such types; a module that describes them is shown all the same.
#[test]
fn what_has_no_name_or_no_value_is_shown() {
    for (bytes, expected) in [
        (&[2, 23, 0, 0, 0][..], "(no value)"),
        (&[2, 23, 0, 0, 1, 0, 0, 0], "\"\""),
        (&[2, 22, 0, 0, 3, 1, 0, 0, 1], "{\"\": bool}"),
    ] {
        assert_eq!(Type::from_bytes(bytes).map(|ty| describe_type(&ty)), Ok(expected.into()));
    }
}
