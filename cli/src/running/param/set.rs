//! `param set`.

use super::session::{Session, find};
use crate::terminal::{Failure, say};
use rohrpost::Name;
use rohrpost::common::{Change, SetParameters};
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, from_word, value_text};
use rohrpost::schema::decode;
use std::process::ExitCode;

pub(super) fn run(session: &mut Session, name: &str, parameter: &str, value: &str) -> Result<ExitCode, Failure> {
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
