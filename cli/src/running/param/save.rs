//! `param save`.

use super::file::Contents;
use super::session::{Session, no_parameters};
use crate::terminal::{Failure, complain, say};
use std::path::Path;
use std::process::ExitCode;

pub(super) fn run(session: &mut Session, names: &[String], output: Option<&Path>) -> Result<ExitCode, Failure> {
    let installation = &session.running.installation;
    let path = output.or(installation.parameters.as_deref()).map(Path::to_owned).ok_or_else(|| {
        let file = installation.path.display();
        format!("no file to save to; use `-o FILE`, or write `parameters = \"tuned.toml\"` at the top of {file}")
    })?;
    let mut contents = Contents::of(&path, installation)?;
    let named: Result<Vec<_>, Failure> = names.iter().map(|name| session.running.module(name)).collect();
    let modules = if names.is_empty() { session.modules()? } else { named? };
    let (mut saved, mut failures) = (Vec::new(), Vec::new());
    for module in modules {
        // A process has one set of parameters, under each of its names.
        let owner = session.running.installation.module(module).map_or(module, |owner| owner.name);
        let name = session.running.text(owner);
        match session.parameters(owner) {
            Ok(parameters) if !parameters.is_empty() => {
                let refusals = contents.put(&name, &parameters);
                saved.push(format!("{name} ({})", parameters.len() - refusals.len()));
                let told = |refusal| format!("{name}: not saved, since its next start would refuse it: {refusal}");
                failures.extend(refusals.into_iter().map(told));
            }
            Ok(_) if names.is_empty() => {}
            Ok(_) => failures.push(no_parameters(&name)),
            Err(error) => failures.push(format!("{error}; its earlier entries in the file stay")),
        }
    }
    for failure in &failures {
        complain(failure);
    }
    if saved.is_empty() {
        return Err("no parameters to save; no file was written".into());
    }
    contents.write(&path, &session.running.installation)?;
    say(format_args!("saved in {}: {}", path.display(), saved.join(", ")));
    Ok(if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
