//! Values from the environment: `{ env = "LASER_PORT", or = "/dev/ttyUSB0" }`.
//!
//! They stand where nodes may differ: in the settings of modules, and where a node writes its own files. What nodes
//! must agree on never comes from an environment. Programs without the variable, such as tools in another shell, read
//! `or`.

use super::merge::{Table, Value, Written};
use super::read::Sources;
use crate::errors::Errors;

/// Tables and keys, besides the settings of modules, that may come from a variable.
const OWN_OF_NODES: [(&str, &str); 2] = [("output", "file"), ("record", "directory")];

/// Whether any value comes from a variable.
pub(super) fn is_any(table: &Table) -> bool {
    table.entries.iter().any(|(_, value)| match value {
        Value::Table { table, written } => written.is_some() && table.get("env").is_some() || is_any(table),
        Value::Tables(tables) => tables.iter().any(is_any),
        Value::Plain(_) | Value::Conflict(_) => false,
    })
}

/// Puts the values of variables in.
pub(super) fn put_in(
    table: &mut Table,
    sources: &Sources,
    variable: &dyn Fn(&str) -> Option<String>,
) -> Result<(), Errors> {
    Variables { sources, variable }.below(table, &mut Vec::new())
}

struct Variables<'a> {
    sources: &'a Sources,
    variable: &'a dyn Fn(&str) -> Option<String>,
}

impl Variables<'_> {
    fn below(&self, table: &mut Table, way: &mut Vec<String>) -> Result<(), Errors> {
        for (key, value) in &mut table.entries {
            way.push(key.clone());
            match value {
                Value::Table { table, written: Some(written) } if table.get("env").is_some() => {
                    *value = Value::Plain(self.value(table, written, way)?);
                }
                Value::Table { table, written } => {
                    self.below(table, way)?;
                    if is_resolved(table) {
                        *written = None;
                    }
                }
                Value::Tables(tables) => tables.iter_mut().try_for_each(|table| self.below(table, way))?,
                Value::Plain(_) | Value::Conflict(_) => {}
            }
            way.pop();
        }
        Ok(())
    }

    fn value(&self, table: &Table, written: &Written, way: &[String]) -> Result<Written, Errors> {
        let wrong = |message: String| self.sources.wrong(written, format!("`{}`: {message}", way.join(".")));
        let way: Vec<&str> = way.iter().map(String::as_str).collect();
        let is_own = match way[..] {
            ["module", "settings", ..] => true,
            [section, key] => OWN_OF_NODES.contains(&(section, key)),
            _ => false,
        };
        if !is_own {
            return Err(wrong(
                "nodes must agree on it, so it cannot come from the environment; variables stand in `settings` of \
                 modules, `file` of [output] and `directory` of [record]"
                    .into(),
            ));
        }
        let texts = ["env", "or"].map(|key| match table.get(key) {
            Some(Value::Plain(written)) => Some(written.text.as_str()),
            _ => None,
        });
        let ([Some(name), Some(or)], 2) = (texts, table.entries.len()) else {
            return Err(wrong(
                "write `{ env = \"NAME\", or = ... }`; programs without the variable read what stands behind `or`"
                    .into(),
            ));
        };
        let name = name.trim_matches(['"', '\'']);
        let text = match (self.variable)(name) {
            None => or.to_owned(),
            Some(said) => as_written(&said, or).map_err(|kind| {
                wrong(format!("the variable {name} is `{said}`; it must be {kind}, as what stands behind `or`"))
            })?,
        };
        Ok(Written { text, place: written.place, variable: Some(name.into()) })
    }
}

/// Whether a variable stands in a table itself: its braces are no longer what it says.
fn is_resolved(table: &Table) -> bool {
    table.entries.iter().any(|(_, value)| match value {
        Value::Plain(written) => written.variable.is_some(),
        Value::Table { table, written } => written.is_none() && is_resolved(table),
        Value::Tables(_) | Value::Conflict(_) => false,
    })
}

/// The value of a variable as TOML writes it, of the kind of another value; else what it must be.
fn as_written(said: &str, or: &str) -> Result<String, &'static str> {
    let kind = match or {
        _ if or.starts_with(['"', '\'']) => return Ok(toml::Value::String(said.into()).to_string()),
        "true" | "false" => ("true or false", said == "true" || said == "false"),
        _ if or.parse::<i64>().is_ok() => ("a whole number", said.parse::<i64>().is_ok()),
        _ if or.parse::<f64>().is_ok() => ("a number", said.parse::<f64>().is_ok_and(f64::is_finite)),
        _ => ("a text, a number, true or false", false),
    };
    let written = if kind.0 == "a number" && said.parse::<i64>().is_ok() { format!("{said}.0") } else { said.into() };
    if kind.1 { Ok(written) } else { Err(kind.0) }
}
