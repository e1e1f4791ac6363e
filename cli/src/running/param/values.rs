//! `param list`, `get`, `set` and `load`.

use super::session::{Session, find, no_parameters};
use crate::terminal::table::table;
use crate::terminal::{Failure, complain, say};
use rohrpost::Name;
use rohrpost::common::{Change, SetParameters};
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, from_file, from_word, value_text};
use rohrpost::schema::{Field, Value, decode};
use rohrpost_config::Saved;
use std::path::Path;
use std::process::ExitCode;

pub(super) fn set_one(session: &mut Session, name: &str, parameter: &str, value: &str) -> Result<ExitCode, Failure> {
    let module = session.running.module(name)?;
    let name = &session.running.text(module);
    let parameters = session.parameters(module)?;
    let wanted = find(&parameters, name, parameter)?;
    let bytes = from_word(&wanted.field.ty, value).map_err(|error| format!("`{parameter}`: {error}"))?;
    let changes = set(session, module, vec![(wanted.field.name.clone(), bytes)], false)?;
    for change in &changes {
        say(format_args!("{name} {}", told(change, wanted)?));
    }
    Ok(ExitCode::SUCCESS)
}

/// Sets all of these, or none; or only checks whether they are valid.
pub(super) fn set(
    session: &mut Session,
    module: Name,
    values: Vec<(String, Vec<u8>)>,
    only_check: bool,
) -> Result<Vec<Change>, Failure> {
    let set = session.tool.set_parameters(module, &SetParameters { values, only_check });
    set.map_err(|error| session.refused(module, error))
}

/// `cruise-m-s: 0.6 -> 0.4 m/s`.
pub(super) fn told(change: &Change, parameter: &Parameter) -> Result<String, Failure> {
    let text = |bytes: &[u8]| decode(&parameter.field.ty, bytes).map(|value| value_text(&value));
    let (old, new) = (text(&change.old)?, parameter.field.with_unit(&text(&change.new)?));
    let name = &change.name;
    let told =
        if change.old == change.new { format!("{name}: {new} as before") } else { format!("{name}: {old} -> {new}") };
    Ok(plain::line(&told).into_owned())
}

pub(super) fn load_file(session: &mut Session, file: Option<&Path>, dry_run: bool) -> Result<ExitCode, Failure> {
    let installation = &session.running.installation;
    let path = file.or(installation.parameters.as_deref()).map(Path::to_owned);
    let path = path.ok_or("no file to load; name one, such as `rohrpost param save -o FILE` writes")?;
    std::fs::metadata(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let saved = Saved::load(&path, installation)?;
    let modules: Vec<Name> = saved.modules().collect();
    let mut failed = modules.is_empty();
    if failed {
        complain(format_args!("{} has no parameters of any module", path.display()));
    }
    for module in modules {
        let name = session.running.text(module);
        let node = session.running.node_of(module);
        if !session.running.shown().contains(&node) {
            say(format_args!("{name} is on node {node}, not on the selected one; leave --node out"));
            continue;
        }
        match load(session, &saved, module, dry_run) {
            Ok(lines) => {
                for line in lines {
                    say(format_args!("{name} {line}"));
                }
            }
            Err(error) => {
                complain(format_args!("{name} keeps its values: {error}"));
                failed = true;
            }
        }
    }
    if dry_run {
        say("(nothing was set)");
    }
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Sets the file's values for one module, all or none; one line for each parameter.
fn load(session: &mut Session, saved: &Saved, module: Name, dry_run: bool) -> Result<Vec<String>, Failure> {
    let values = saved.document(&session.running.installation).values::<Value>(module)?;
    let parameters = session.parameters(module)?;
    let name = session.running.text(module);
    let mut wanted = Vec::with_capacity(values.len());
    for saved_value in values {
        let at = format!("{}:{}", saved.path.display(), saved_value.line);
        let parameter = find(&parameters, &name, &saved_value.name).map_err(|error| format!("{at}: {error}"))?;
        let bytes = from_file(&parameter.field.ty, &saved_value.value)
            .map_err(|error| format!("{at}: `{}`: {error}", saved_value.name))?;
        wanted.push((parameter.field.name.clone(), bytes));
    }
    let changes = set(session, module, wanted, dry_run)?;
    changes.iter().map(|change| told(change, find(&parameters, &name, &change.name)?)).collect()
}

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
