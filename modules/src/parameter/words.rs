//! Values of parameters as people and files write them.

use rohrpost_schema::{Type, Value, WalkError, describe_type, encode, parse_argument};

/// A value for people: a choice as a word in kebab-case, all else as ever.
///
/// ```
/// use rohrpost_modules::{parameter::value_text, schema::Value};
/// assert_eq!(value_text(&Value::unit_variant("TurnLeft")), "turn-left");
/// assert_eq!(value_text(&Value::F(0.5)), "0.5");
/// ```
pub fn value_text(value: &Value) -> String {
    match value {
        Value::Variant(name, payload) if **payload == Value::Null => kebab(name),
        other => other.to_string(),
    }
}

/// The bytes of a value that a file gives.
///
/// # Errors
/// What is wrong with it. On a command line all is text; in a file a number stands without quotes.
pub fn from_file(ty: &Type, value: &Value) -> Result<Vec<u8>, String> {
    if let (Value::Text(text), false) = (value, matches!(ty, Type::Text | Type::Enum { .. })) {
        return Err(format!("{text:?} is text; write a value of type {}, without quotes", type_text(ty)));
    }
    encode(ty, value).map_err(|error| told(ty, &error))
}

/// The bytes of a value that was typed as one word.
///
/// ```
/// use rohrpost_modules::{parameter::from_word, schema::Type};
///
/// assert_eq!(from_word(&Type::F64, "0.5"), Ok(0.5_f64.to_le_bytes().to_vec()));
/// assert!(from_word(&Type::F64, "fast").is_err());
/// ```
///
/// # Errors
/// What was expected.
pub fn from_word(ty: &Type, word: &str) -> Result<Vec<u8>, String> {
    let value = parse_argument(ty, word).map_err(|error| told(ty, &error))?;
    encode(ty, &value).map_err(|error| told(ty, &error))
}

/// A type as people read it; of a choice, its words.
pub(super) fn type_text(ty: &Type) -> String {
    match ty {
        Type::Enum { variants, .. } => {
            variants.iter().map(|variant| kebab(&variant.name)).collect::<Vec<_>>().join("|")
        }
        _ => describe_type(ty),
    }
}

fn told(ty: &Type, error: &WalkError) -> String {
    error.to_string().replace(&describe_type(ty), &type_text(ty))
}

/// A value as TOML writes it, so that it reads back as the same.
///
/// ```
/// use rohrpost_modules::{parameter::toml_text, schema::Value};
/// assert_eq!(toml_text(&Value::unit_variant("TurnLeft")), "\"turn-left\"");
/// assert_eq!(toml_text(&Value::F(1.0)), "1.0");
/// ```
pub fn toml_text(value: &Value) -> String {
    match value {
        // In TOML it has small letters.
        Value::F(x) if x.is_nan() => "nan".into(),
        Value::F(x) => format!("{x:?}"),
        Value::Text(text) => toml::Value::String(text.clone()).to_string(),
        Value::Variant(..) => toml::Value::String(value_text(value)).to_string(),
        other => other.to_string(),
    }
}

/// `TurnLeft` as `turn-left`.
fn kebab(name: &str) -> String {
    let mut word = String::with_capacity(name.len() + 2);
    for (at, char) in name.char_indices() {
        if char.is_uppercase() && at > 0 && !word.ends_with('-') {
            word.push('-');
        }
        if char == '_' { word.push('-') } else { word.extend(char.to_lowercase()) }
    }
    word
}
