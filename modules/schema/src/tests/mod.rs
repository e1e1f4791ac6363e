//! Types that are known against types that are not; random types; tables of mistakes.

mod budget;
mod golden;
mod random;
mod tables;
mod zoo;

use super::{Type, Value, WalkError, decode, describe_type, encode, numbers};

fn map<const N: usize>(entries: [(&str, Value); N]) -> Value {
    Value::Map(entries.map(|(name, value)| (name.into(), value)).into())
}

fn text(text: &str) -> Value {
    Value::Text(text.into())
}

fn variant(name: &str, payload: Value) -> Value {
    Value::Variant(name.into(), Box::new(payload))
}

/// Equal, where a NaN equals a NaN.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::F(a), Value::F(b)) => a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
        (Value::List(a), Value::List(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (Value::Map(a), Value::Map(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|((x, a), (y, b))| x == y && same(a, b))
        }
        (Value::Variant(x, a), Value::Variant(y, b)) => x == y && same(a, b),
        _ => a == b,
    }
}

fn through_json(value: &Value) -> Value {
    serde_json::from_str(&serde_json::to_string(value).unwrap()).unwrap()
}

/// What holds for all bytes that decode: they have one value, which survives JSON; printing and plotting end.
fn check_value(ty: &Type, value: &Value) -> Vec<u8> {
    let bytes = encode(ty, value).unwrap();
    let again = decode(ty, &bytes).unwrap();
    assert!(same(value, &again), "{value:?}\nbecame\n{again:?}\nas {}", describe_type(ty));
    let from_json = encode(ty, &through_json(value)).unwrap();
    assert!(same(value, &decode(ty, &from_json).unwrap()), "JSON of {value:?} as {ty:?}");
    assert!(value.to_string().lines().count() <= 1, "one line");
    numbers(value, 4);
    bytes
}

/// No beginning of a message is a message.
fn check_cuts(ty: &Type, bytes: &[u8]) {
    for end in 0..bytes.len() {
        assert!(decode(ty, &bytes[..end]).is_err(), "{end} of {} bytes as {ty:?}", bytes.len());
    }
    let longer = [bytes, &[0]].concat();
    assert_eq!(decode(ty, &longer).unwrap_err().to_string(), "1 byte too many");
}

fn error_text<T: std::fmt::Debug>(result: Result<T, WalkError>) -> String {
    result.unwrap_err().to_string()
}
