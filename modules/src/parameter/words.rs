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

/// A value of a parameter as TOML writes it, so that it reads back as the same.
///
/// ```
/// use rohrpost_modules::{parameter::toml_text, schema::{Type, Value}};
/// assert_eq!(toml_text(&Type::F64, &Value::F(1.0)), "1.0");
/// assert_eq!(toml_text(&Type::Text, &Value::Text("a\tb".into())), r#""a\tb""#);
/// ```
pub fn toml_text(ty: &Type, value: &Value) -> String {
    let quoted = |text: String| toml::Value::String(text).to_string();
    match value {
        // In TOML it has small letters.
        Value::F(x) if x.is_nan() => "nan".into(),
        Value::F(x) => format!("{x:?}"),
        Value::Text(text) => quoted(text.clone()),
        Value::Variant(name, _) => {
            // Of two variants that differ in case or hyphens alone, the word of one reads as the other, or as none.
            let word = value_text(value);
            let is_same = encode(ty, &Value::Text(word.clone())).ok() == encode(ty, value).ok();
            quoted(if is_same { word } else { name.to_string() })
        }
        other => other.to_string(),
    }
}

/// A name as the key of a line of TOML.
///
/// ```
/// use rohrpost_modules::parameter::toml_key;
/// assert_eq!((toml_key("near-m"), toml_key("two\nlines")), ("near-m".into(), r#""two\nlines""#.into()));
/// ```
pub fn toml_key(name: &str) -> String {
    let line = toml::Table::from_iter([(name.to_owned(), toml::Value::Boolean(true))]).to_string();
    line.rsplit_once(" = ").map_or_else(String::new, |(key, _)| key.to_owned())
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
