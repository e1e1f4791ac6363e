//! The file that `param save` writes: TOML that people can read and `param load` can load.

use crate::terminal::Failure;
use crate::terminal::whole_file::write_whole;
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, Refusal, toml_key, toml_text};
use rohrpost::schema::Field;
use rohrpost_config::{Installation, Saved};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

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
