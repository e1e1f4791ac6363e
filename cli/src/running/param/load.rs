//! `param load`.

use super::session::{Session, find};
use super::set::{set, told};
use crate::terminal::{Failure, complain, say};
use rohrpost::Name;
use rohrpost::parameter::from_file;
use rohrpost::schema::Value;
use rohrpost_config::Saved;
use std::path::Path;
use std::process::ExitCode;

pub(super) fn run(session: &mut Session, file: Option<&Path>, dry_run: bool) -> Result<ExitCode, Failure> {
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
