//! `param list` and `param get`.

use super::{Session, find, no_parameters};
use crate::terminal::table::table;
use crate::terminal::{Failure, complain, say};
use rohrpost::parameter::{Parameter, value_text};
use rohrpost::schema::Field;
use std::process::ExitCode;

/// Parameters of one module, or of all.
pub(super) fn list(session: &mut Session, name: Option<&str>, json: bool) -> Result<ExitCode, Failure> {
    if let Some(name) = name {
        return get(session, name, None, json);
    }
    let (mut found, mut without, mut silent) = (Vec::new(), Vec::new(), Vec::new());
    for module in session.modules()? {
        let name = session.running.text(module);
        match session.parameters(module) {
            Ok(parameters) if parameters.is_empty() => without.push(name),
            Ok(parameters) => found.extend(parameters.into_iter().map(|parameter| (name.clone(), parameter))),
            Err(error) => silent.push(error),
        }
    }
    if json {
        let objects: Result<Vec<_>, Failure> = found.iter().map(|(name, parameter)| object(name, parameter)).collect();
        say(serde_json::to_string(&objects?)?);
    } else {
        let rows: Result<Vec<_>, Failure> = found
            .iter()
            .map(|(name, parameter)| {
                let [parameter, value, unit, range, text] = row(parameter)?;
                Ok([name.clone(), parameter, value, unit, range, text])
            })
            .collect();
        if !found.is_empty() {
            say(table(["module", "parameter", ">value", "unit", "range", "text"], rows?).trim_end());
        }
        if !without.is_empty() {
            say(format_args!("without parameters: {}", without.join(", ")));
        }
    }
    for error in &silent {
        complain(error);
    }
    Ok(if silent.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The parameters of a module, or one of them.
pub(super) fn get(session: &mut Session, name: &str, parameter: Option<&str>, json: bool) -> Result<ExitCode, Failure> {
    let module = session.running.module(name)?;
    let name = &session.running.text(module);
    let all = session.parameters(module)?;
    let shown = match parameter {
        Some(parameter) => std::slice::from_ref(find(&all, name, parameter)?),
        None => &all[..],
    };
    if json {
        let objects: Result<Vec<_>, Failure> = shown.iter().map(|parameter| object(name, parameter)).collect();
        say(serde_json::to_string(&objects?)?);
    } else if shown.is_empty() {
        say(no_parameters(name));
    } else {
        let rows: Result<Vec<_>, Failure> = shown.iter().map(row).collect();
        say(table(["parameter", ">value", "unit", "range", "text"], rows?).trim_end());
    }
    Ok(ExitCode::SUCCESS)
}

fn row(parameter: &Parameter) -> Result<[String; 5], Failure> {
    let Field { name, unit, text, .. } = &parameter.field;
    let value = value_text(&parameter.value()?);
    Ok([name.clone(), value, unit.clone(), parameter.range(), text.clone()])
}

fn object(module: &str, parameter: &Parameter) -> Result<serde_json::Value, Failure> {
    let Field { name, unit, text, ty, .. } = &parameter.field;
    let (least, most) = parameter.field.bounds();
    Ok(serde_json::json!({
        "module": module, "parameter": name, "value": parameter.value()?, "unit": unit,
        "type": rohrpost::schema::describe_type(ty),
        "min": least, "max": most, "text": text,
    }))
}
