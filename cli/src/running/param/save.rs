//! `param save`, and the file that it writes: TOML that people can read and `param load` can load.

use super::session::{Session, no_parameters};
use crate::terminal::whole_file::write_whole;
use crate::terminal::{Failure, complain, say};
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, Refusal, toml_key, toml_text};
use rohrpost::schema::Field;
use rohrpost_config::{Installation, Saved};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
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

/// The file's content, by module name.
pub(super) struct Contents {
    modules: BTreeMap<String, String>,
}

impl Contents {
    /// The existing file's content without its comments; empty if there is no file.
    pub(super) fn of(path: &Path, installation: &Installation) -> Result<Self, Failure> {
        let saved = Saved::load(path, installation).map_err(|errors| {
            let problem = errors.problems().first().map_or("", |problem| problem.message.as_str());
            format!(
                "{} is no file of parameters, and is left alone: {problem}; name another, or fix it",
                path.display()
            )
        })?;
        let mut modules = BTreeMap::new();
        let document = saved.document(installation);
        for module in saved.modules() {
            let mut text = String::new();
            for saved in document.texts(module) {
                let _ = writeln!(text, "{} = {}", toml_key(&saved.name), saved.value);
            }
            modules.insert(installation.classes.format(module), text);
        }
        Ok(Self { modules })
    }

    /// Replaces a module's entries. Returns those that its next start would refuse, which the file does not get.
    pub(super) fn put(&mut self, module: &str, parameters: &[Parameter]) -> Vec<Refusal> {
        let (mut text, mut refusals) = (String::new(), Vec::new());
        for parameter in parameters {
            let Field { name, ty, text: purpose, .. } = &parameter.field;
            let range = parameter.field.with_unit(&parameter.range());
            match parameter.checked() {
                Ok(value) => {
                    let _ = writeln!(text, "# {} ({})", one_line(purpose), one_line(&range));
                    let _ = writeln!(text, "{} = {}", toml_key(name), toml_text(ty, &value));
                }
                Err(refusal) => refusals.push(refusal),
            }
        }
        self.modules.insert(module.to_owned(), text);
        refusals
    }

    pub(super) fn write(&self, path: &Path, installation: &Installation) -> Result<(), Failure> {
        Ok(write_whole(path, &self.text(installation))?)
    }

    fn text(&self, installation: &Installation) -> String {
        let mut text = format!(
            "# Parameters of `{}`, written by `rohrpost param save`. When a module starts they go before the settings \
            of the\n\
             # same names, if this is the file that the configuration names as `parameters`. `rohrpost param load` \
             sets them\n\
             # while it runs.\n",
            installation.name
        );
        for (module, values) in &self.modules {
            let _ = write!(text, "\n[{}]\n{values}", toml_key(module));
        }
        text
    }
}

/// Text for a comment: a module's text must end with the line.
fn one_line(text: &str) -> Cow<'_, str> {
    plain::line(text)
}
