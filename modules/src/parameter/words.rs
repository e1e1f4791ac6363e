//! Values of parameters as people and files write them.

use crate::value::Value;

/// A value for people: a choice as a word in kebab-case, all else as ever.
///
/// ```
/// use rohrpost_modules::{parameter::value_text, value::Value};
/// assert_eq!(value_text(&Value::unit_variant("TurnLeft")), "turn-left");
/// assert_eq!(value_text(&Value::F(0.5)), "0.5");
/// ```
pub fn value_text(value: &Value) -> String {
    match value {
        Value::Variant(name, payload) if **payload == Value::Null => kebab(name),
        other => other.to_string(),
    }
}

/// A value as TOML writes it, so that it reads back as the same.
///
/// ```
/// use rohrpost_modules::{parameter::toml_text, value::Value};
/// assert_eq!(toml_text(&Value::unit_variant("TurnLeft")), "\"turn-left\"");
/// assert_eq!(toml_text(&Value::F(1.0)), "1.0");
/// ```
pub fn toml_text(value: &Value) -> String {
    match value {
        Value::F(x) => format!("{x:?}"),
        Value::Text(text) => toml::Value::String(text.clone()).to_string(),
        Value::Variant(..) => toml::Value::String(value_text(value)).to_string(),
        other => other.to_string(),
    }
}

/// `TurnLeft` as `turn-left`.
pub(super) fn kebab(name: &str) -> String {
    let mut word = String::with_capacity(name.len() + 2);
    for (at, char) in name.char_indices() {
        if char.is_uppercase() && at > 0 && !word.ends_with('-') {
            word.push('-');
        }
        if char == '_' { word.push('-') } else { word.extend(char.to_lowercase()) }
    }
    word
}
