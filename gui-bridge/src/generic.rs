//! Data of types that this crate does not know: numbers become curves, all else becomes text.

use crate::scene::Scene;
use crate::states::cut;
use rerun::{EntityPath, EntityPathPart, Scalars, TextLog};
use rohrpost::schema::Value;
use std::fmt::Write;

/// A list longer than this is described, not plotted.
pub const PLOTTED_LIST_MAX: usize = 16;
/// Curves of one datum.
pub const CURVES_MAX: usize = 64;
/// Levels of a datum that are entered.
const DEPTH_MAX: usize = 8;
/// Bytes of a datum's text.
const TEXT_MAX: usize = 2048;

/// A datum taken apart.
#[derive(Debug, Default, PartialEq)]
pub struct Flat {
    /// Numbers and truths with the way to each, at most [`CURVES_MAX`].
    pub curves: Vec<(Vec<String>, f64)>,
    /// The rest, a line for each: `way: value`.
    pub text: String,
}

impl Scene {
    /// Data that `module` gives under the name `data`, below the entity `data/MODULE/DATA`.
    pub fn generic(&mut self, module: &str, data: &str, value: &Value) {
        let Flat { curves, text } = flatten(value);
        let below = |way: &[String]| {
            let parts = ["data", module, data].into_iter().chain(way.iter().map(String::as_str));
            EntityPath::new(parts.map(EntityPathPart::new).collect())
        };
        for (way, number) in curves {
            self.log(below(&way), &Scalars::single(number));
        }
        let entity = below(&[]);
        let said = self.texts.last.entry(entity.clone()).or_default();
        if *said == text {
            return;
        }
        said.clone_from(&text);
        self.log(entity, &TextLog::new(format!("{module} {data}\n{text}")));
    }
}

/// Takes a datum apart.
pub fn flatten(value: &Value) -> Flat {
    let mut flat = Flat::default();
    flat.enter(&mut Vec::new(), value);
    flat.text.truncate(cut(flat.text.trim_end(), TEXT_MAX).len());
    flat
}

impl Flat {
    fn enter(&mut self, way: &mut Vec<String>, value: &Value) {
        if let Some(number) = number(value)
            && self.curves.len() < CURVES_MAX
        {
            return self.curves.push((way.clone(), number));
        }
        match value {
            Value::Map(fields) if way.len() < DEPTH_MAX => {
                for (name, field) in fields {
                    self.step(way, name.to_string(), field);
                }
            }
            Value::List(items) if way.len() < DEPTH_MAX && plotted(items) => {
                for (index, item) in items.iter().enumerate() {
                    self.step(way, index.to_string(), item);
                }
            }
            Value::Variant(case, inner) if way.len() < DEPTH_MAX => {
                self.line(way, case);
                self.step(way, case.to_string(), inner);
            }
            // What an absent option or a unit would say is said by the case that holds it.
            Value::Null => {}
            other => self.line(way, &brief(other)),
        }
    }

    fn step(&mut self, way: &mut Vec<String>, name: String, value: &Value) {
        way.push(name);
        self.enter(way, value);
        way.pop();
    }

    fn line(&mut self, way: &[String], text: &str) {
        if self.text.len() > TEXT_MAX {
            return;
        }
        if !way.is_empty() {
            self.text.push_str(&way.join("/"));
            self.text.push_str(": ");
        }
        self.text.push_str(text);
        self.text.push('\n');
    }
}

/// What a curve can show.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Bool(truth) => Some(f64::from(u8::from(*truth))),
        Value::I(number) => Some(*number as f64),
        Value::U(number) => Some(*number as f64),
        Value::F(number) => Some(*number),
        _ => None,
    }
}

fn plotted(items: &[Value]) -> bool {
    items.len() <= PLOTTED_LIST_MAX && items.iter().all(|item| number(item).is_some())
}

/// A value in a few words.
fn brief(value: &Value) -> String {
    match value {
        Value::Null => "none".into(),
        Value::Bool(truth) => truth.to_string(),
        Value::I(number) => number.to_string(),
        Value::U(number) => number.to_string(),
        Value::F(number) => number.to_string(),
        Value::Char(character) => character.to_string(),
        Value::Text(text) => cut(text, TEXT_MAX).into(),
        Value::Bytes(bytes) => format!("{} bytes", bytes.len()),
        Value::Map(fields) => format!("{} fields", fields.len()),
        Value::Variant(case, _) => case.to_string(),
        Value::List(items) => list(items),
    }
}

fn list(items: &[Value]) -> String {
    let numbers: Vec<f64> = items.iter().filter_map(number).collect();
    let mut text = format!("{} items", items.len());
    if numbers.len() == items.len() && !items.is_empty() {
        let (least, most) = numbers
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), number| (least.min(*number), most.max(*number)));
        // Writing to a String cannot fail.
        let _ = write!(text, ", {least} to {most}");
    } else if let Some(first) = items.first().filter(|first| !matches!(first, Value::List(_) | Value::Map(_))) {
        let _ = write!(text, ", the first {}", brief(first));
    }
    text
}

#[cfg(test)]
mod tests;
