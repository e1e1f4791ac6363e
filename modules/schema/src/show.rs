//! Values for people: one line of text, and numbers to plot.

use crate::{Label, Value};
use std::fmt::{self, Write};

/// How many elements of a list [`Value`]'s `Display` prints.
pub const LIST_SHOWN: usize = 8;

/// Entries of a map that are always printed, as structs of this size are to be seen whole.
const ENTRIES_SHOWN: usize = 32;

/// One line for people, lists cut after [`LIST_SHOWN`] elements. A precision, as in `{:.3}`, is that of all numbers
/// with a fraction.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        show(self, LIST_SHOWN, f)
    }
}

impl Value {
    /// One line for people, lists cut after `limit` elements. Prints with a precision as `Display` does.
    ///
    /// ```
    /// use rohrpost_schema::Value;
    /// let ranges = Value::List((0..360).map(|i| Value::F(f64::from(i) / 8.0)).collect());
    /// let scan = Value::Map(vec![("beams".into(), Value::U(360)), ("ranges_m".into(), ranges)]);
    /// assert_eq!(scan.display(2).to_string(), "{beams: 360, ranges_m: [0, 0.125, … 358 more]}");
    /// assert_eq!(format!("{:.1}", scan.display(2)), "{beams: 360, ranges_m: [0.0, 0.1, … 358 more]}");
    /// ```
    pub fn display(&self, limit: usize) -> Shown<'_> {
        Shown { value: self, limit }
    }
}

/// A value to be printed, see [`Value::display`].
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    value: &'a Value,
    limit: usize,
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        show(self.value, self.limit, f)
    }
}

fn show(value: &Value, limit: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match value {
        Value::Null => f.write_str("null"),
        Value::Bool(flag) => write!(f, "{flag}"),
        Value::I(n) => write!(f, "{n}"),
        Value::U(n) => write!(f, "{n}"),
        Value::F(x) => show_float(*x, f),
        Value::Char(char) => write!(f, "{char:?}"),
        Value::Text(text) => write!(f, "{text:?}"),
        Value::Bytes(bytes) => {
            f.write_char('[')?;
            show_some(bytes, limit, f, |byte, f| write!(f, "{byte}"))?;
            f.write_char(']')
        }
        Value::List(values) => {
            f.write_char('[')?;
            show_some(values, limit, f, |value, f| show(value, limit, f))?;
            f.write_char(']')
        }
        Value::Map(entries) => {
            f.write_char('{')?;
            show_some(entries, limit.max(ENTRIES_SHOWN), f, |(name, value), f| {
                show_name(name, f)?;
                f.write_str(": ")?;
                show(value, limit, f)
            })?;
            f.write_char('}')
        }
        Value::Variant(name, payload) => {
            show_name(name, f)?;
            if **payload == Value::Null {
                return Ok(());
            }
            f.write_char('(')?;
            show(payload, limit, f)?;
            f.write_char(')')
        }
    }
}

fn show_some<T>(
    parts: &[T],
    limit: usize,
    f: &mut fmt::Formatter<'_>,
    show: impl Fn(&T, &mut fmt::Formatter<'_>) -> fmt::Result,
) -> fmt::Result {
    for (index, part) in parts.iter().take(limit).enumerate() {
        f.write_str(if index == 0 { "" } else { ", " })?;
        show(part, f)?;
    }
    match parts.len().saturating_sub(limit) {
        0 => Ok(()),
        hidden => write!(f, "{}… {hidden} more", if limit == 0 { "" } else { ", " }),
    }
}

fn show_float(x: f64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match f.precision() {
        Some(decimals) if x.abs() < 1e16 => write!(f, "{x:.decimals$}"),
        _ if x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs()) => write!(f, "{x}"),
        _ => write!(f, "{x:e}"),
    }
}

/// Names stand bare where nobody can mistake them, also not for control characters of the terminal.
fn show_name(name: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let bare = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '+');
    if !name.is_empty() && name.chars().all(bare) { f.write_str(name) } else { write!(f, "{name:?}") }
}

/// A value of a type that is a word, as the key of a map: without quotes, and exact.
pub(crate) fn word(value: &Value) -> Label {
    match value {
        Value::Char(char) => Label::from(&*char.encode_utf8(&mut [0; 4])),
        Value::Text(text) => Label::from(&**text),
        Value::Variant(name, _) => name.clone(),
        other => other.to_string().into(),
    }
}

/// The numbers inside a value, for plots: each with its path, as `pose.x_m` and `ranges_m[3]`. `true` counts 1, `false`
/// 0.
///
/// Of each list only the first `limit` elements are taken. A value that is a number has the empty path.
///
/// ```
/// use rohrpost_schema::{Value, numbers};
/// let value = Value::Map(vec![("on".into(), Value::Bool(true)), ("levels".into(), Value::Bytes(vec![7, 8, 9]))]);
/// assert_eq!(numbers(&value, 2), [("on".into(), 1.0), ("levels[0]".into(), 7.0), ("levels[1]".into(), 8.0)]);
/// ```
pub fn numbers(value: &Value, limit: usize) -> Vec<(String, f64)> {
    let mut found = Vec::new();
    collect(value, limit, &mut String::new(), &mut found);
    found
}

fn collect(value: &Value, limit: usize, path: &mut String, found: &mut Vec<(String, f64)>) {
    match value {
        Value::Bool(flag) => found.push((path.clone(), f64::from(u8::from(*flag)))),
        Value::I(n) => found.push((path.clone(), *n as f64)),
        Value::U(n) => found.push((path.clone(), *n as f64)),
        Value::F(x) => found.push((path.clone(), *x)),
        Value::Bytes(bytes) => {
            found.extend(
                bytes.iter().take(limit).enumerate().map(|(i, byte)| (format!("{path}[{i}]"), f64::from(*byte))),
            );
        }
        Value::List(values) => {
            for (index, value) in values.iter().take(limit).enumerate() {
                below(&format!("[{index}]"), value, limit, path, found);
            }
        }
        Value::Map(entries) => {
            for (name, value) in entries {
                below(name, value, limit, path, found);
            }
        }
        Value::Variant(name, payload) => below(name, payload, limit, path, found),
        Value::Null | Value::Char(_) | Value::Text(_) => {}
    }
}

fn below(step: &str, value: &Value, limit: usize, path: &mut String, found: &mut Vec<(String, f64)>) {
    let before = path.len();
    if before > 0 && !step.starts_with('[') {
        path.push('.');
    }
    path.push_str(step);
    collect(value, limit, path, found);
    path.truncate(before);
}
