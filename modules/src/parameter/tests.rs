//! What declared parameters take and refuse, from a file and from afar.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::{Parameter, ParameterSet, Refusal, from_file, toml_text, value_text};
use proptest::prelude::*;
use rohrpost_schema::{Value, decode, encode, parse_argument};

#[crate::choice(crate = crate::macro_support)]
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Left,
    TurnRight,
}

#[crate::parameters(crate = crate::macro_support)]
#[derive(Debug, PartialEq)]
struct Settings {
    /// Not a parameter.
    motor: String,
    /// Speed
    /// where there is room.
    #[parameter(unit = "m/s", min = 0.0, max = 1.5, default = 0.5)]
    cruise_m_s: f64,
    /// Beams to leave out.
    #[parameter(max = 10, default = 2)]
    skip: u8,
    /// A number below zero, too.
    #[parameter(min = -3, default = i16::MAX)]
    offset: i16,
    /// The largest there are.
    #[parameter(default = u64::MAX)]
    count: u64,
    /// A share.
    #[parameter(min = 0.1, max = 0.9, default = 0.1)]
    share: f32,
    /// Where to look first.
    #[parameter(default = Side::Left)]
    side: Side,
    /// Whether to look at all.
    #[parameter(default = true)]
    look: bool,
    /// What to say.
    #[parameter(default = "hello")]
    motto: String,
}

const INDEX: [&str; 8] = ["cruise-m-s", "skip", "offset", "count", "share", "side", "look", "motto"];

fn read(text: &str) -> Result<Settings, String> {
    toml::from_str(&format!("motor = \"motor.0\"\n{text}")).map_err(|error| error.message().to_owned())
}

fn settings() -> Settings {
    read("").unwrap()
}

fn parameter(name: &str) -> (usize, Parameter) {
    let index = settings().names().iter().position(|known| *known == name).unwrap();
    (index, settings().get(index).unwrap())
}

#[test]
fn a_struct_tells_of_its_parameters_and_of_nothing_else() {
    let settings = settings();
    assert_eq!(settings.names(), INDEX);
    assert!(settings.get(INDEX.len()).is_none());
    let ranges: Vec<String> = (0..INDEX.len()).map(|index| settings.get(index).unwrap().range()).collect();
    assert_eq!(ranges, ["0..=1.5", "at most 10", "at least -3", "u64", "0.1..=0.9", "left|turn-right", "bool", "text"]);
    let cruise = settings.get(0).unwrap();
    assert_eq!((cruise.field.text.as_str(), cruise.field.unit.as_str()), ("Speed where there is room.", "m/s"));
    assert_eq!(cruise.value().unwrap(), Value::F(0.5));
    let values: Vec<String> =
        (0..INDEX.len()).map(|index| value_text(&settings.get(index).unwrap().value().unwrap())).collect();
    assert_eq!(values, ["0.5", "2", "32767", "18446744073709551615", "0.1", "left", "true", "\"hello\""]);
}

#[test]
fn a_file_is_read_with_the_same_check() {
    let good = read("cruise-m-s = 1\nskip = 10\ncount = 0\nshare = 0.9\nside = \"turn-right\"\nlook = false");
    let good = good.unwrap();
    assert_eq!((good.cruise_m_s, good.skip, good.share, good.side), (1.0, 10, 0.9, Side::TurnRight));
    for (text, says) in [
        ("cruise-m-s = 1.500001", "`cruise-m-s` is 1.500001 m/s, out of range: 0..=1.5 m/s"),
        ("cruise-m-s = -1e-300", "`cruise-m-s` is -1e-300 m/s, out of range: 0..=1.5 m/s"),
        ("cruise-m-s = nan", "`cruise-m-s` is NaN m/s, out of range: 0..=1.5 m/s"),
        ("cruise-m-s = -inf", "`cruise-m-s` is -inf m/s, out of range: 0..=1.5 m/s"),
        ("cruise-m-s = \"0.5\"", "`cruise-m-s`: \"0.5\" is text; write a value of type f64, without quotes"),
        ("cruise-m-s = [0.5]", "`cruise-m-s`: expected a number (f64)"),
        ("skip = 11", "`skip` is 11, out of range: at most 10"),
        ("skip = 256", "`skip`: 256 is out of range: u8 is 0 to 255"),
        ("skip = 1.5", "`skip`: "),
        ("offset = -4", "`offset` is -4, out of range: at least -3"),
        ("share = 0.95", "`share` is 0.95, out of range: 0.1..=0.9"),
        ("side = \"up\"", "`side`: "),
        ("look = 1", "`look`: expected true or false"),
        ("look = 1979-05-27", "`look`: "),
        ("motto = 1", "`motto`: "),
        ("cruise = 1.0", "unknown field `cruise`"),
        ("cruise_m_s = 1.0", "unknown field `cruise_m_s`"),
    ] {
        let said = read(text).unwrap_err();
        assert!(said.contains(says), "{text}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn what_is_set_is_stored_and_negative_zero_is_zero() {
    let mut settings = settings();
    for (name, text) in [("cruise-m-s", "-0.0"), ("side", "turn_right"), ("motto", "a\nb"), ("look", "false")] {
        let (index, parameter) = parameter(name);
        let bytes = encode(&parameter.field.ty, &parse_argument(&parameter.field.ty, text).unwrap()).unwrap();
        let accepted = settings.accept(index, &bytes).unwrap();
        settings.put(index, &accepted);
        assert_eq!(settings.get(index).unwrap().value, accepted, "{name}");
    }
    assert!(settings.cruise_m_s == 0.0 && settings.cruise_m_s.is_sign_positive());
    assert_eq!((settings.side, settings.motto.as_str(), settings.look), (Side::TurnRight, "a\nb", false));
    assert_eq!(settings.motor, "motor.0");
}

#[test]
fn an_index_past_the_end_is_refused_and_stores_nothing() {
    let mut settings = settings();
    assert_eq!(settings.accept(99, &[0]), Err(Refusal::NoParameters));
    settings.put(99, &[0]);
    assert_eq!(settings, self::settings());
}

proptest! {
    #[test]
    fn a_number_is_taken_if_and_only_if_it_lies_in_the_range(bits: u64) {
        // Of all bit patterns, so also NaNs, infinities, tiny and huge ones.
        let x = f64::from_bits(bits);
        let accepted = settings().accept(0, &x.to_le_bytes());
        prop_assert_eq!(accepted.is_ok(), (0.0..=1.5).contains(&x), "{}", x);
        if let Ok(bytes) = accepted {
            prop_assert_eq!(bytes, (x + 0.0).to_le_bytes().to_vec());
        }
    }

    #[test]
    fn so_is_one_near_the_edges(steps in -3i64..=3, high: bool) {
        let edge = if high { 1.5f64 } else { 0.0 };
        let x = if edge == 0.0 && steps < 0 {
            -f64::from_bits(-steps as u64)
        } else {
            f64::from_bits((edge.to_bits() as i64 + steps) as u64)
        };
        prop_assert_eq!(settings().accept(0, &x.to_le_bytes()).is_ok(), if high { steps <= 0 } else { steps >= 0 });
    }

    #[test]
    fn whole_numbers_are_validated_by_their_value(n: i16) {
        let (index, parameter) = parameter("offset");
        let bytes = encode(&parameter.field.ty, &Value::I(n.into())).unwrap();
        prop_assert_eq!(settings().accept(index, &bytes).is_ok(), n >= -3);
    }

    #[test]
    fn no_bytes_bring_it_down_and_what_is_taken_reads_back(index in 0usize..10, bytes: Vec<u8>) {
        let mut settings = settings();
        if let Ok(accepted) = settings.accept(index, &bytes) {
            settings.put(index, &accepted);
            let after = settings.get(index).unwrap();
            prop_assert_eq!(&after.value, &accepted);
            prop_assert_eq!(settings.accept(index, &accepted), Ok(accepted), "what is stored would be taken again");
        } else {
            settings.put(index, &bytes);
        }
        // Whatever was put without being accepted: what is stored can still be told.
        for index in 0..INDEX.len() {
            let parameter = settings.get(index).unwrap();
            prop_assert!(parameter.value().is_ok());
        }
    }

    #[test]
    fn what_is_written_into_a_file_reads_back(
        cruise in 0.0..=1.5f64,
        share in 0.1..=0.9f32,
        count: u64,
        motto: String,
        side: bool,
    ) {
        let mut before = settings();
        (before.cruise_m_s, before.share, before.count, before.motto) = (cruise, share, count, motto);
        before.side = if side { Side::TurnRight } else { Side::Left };
        let mut text = String::from("motor = \"motor.0\"\n");
        for index in 0..INDEX.len() {
            let parameter = before.get(index).unwrap();
            let value = parameter.value().unwrap();
            text += &format!("{} = {}\n", parameter.field.name, toml_text(&parameter.field.ty, &value));
        }
        let after: Settings = toml::from_str(&text).map_err(|error| TestCaseError::fail(format!("{error}\n{text}")))?;
        prop_assert_eq!(after, before);
    }

    #[test]
    fn no_description_of_a_liar_brings_a_tool_down(bytes: Vec<u8>, least: Option<Vec<u8>>, most: Option<Vec<u8>>) {
        for index in 0..INDEX.len() {
            let honest = settings().get(index).unwrap();
            let liar = Parameter { field: honest.field.bounded(least.clone(), most.clone()), value: bytes.clone() };
            let _ = (liar.value().map(|value| value_text(&value)), liar.range());
            let _ = decode(&liar.field.ty, &bytes).map(|value| from_file(&liar.field.ty, &value));
        }
        let _ = postcard::from_bytes::<crate::common::ParameterPage>(&bytes);
        let _ = postcard::from_bytes::<crate::common::SetParameters>(&bytes);
    }
}
