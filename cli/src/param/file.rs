//! The file that `param save` writes: TOML that people can read and `param load` can load.

use crate::terminal::Failure;
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, toml_text};
use rohrpost_config::{Installation, Saved};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
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
            for saved in document.values::<toml::Value>(module)? {
                let _ = writeln!(text, "{} = {}", key(&saved.name), saved.value);
            }
            modules.insert(installation.classes.format(module), text);
        }
        Ok(Self { modules })
    }

    /// Replaces a module's entries.
    pub(super) fn put(&mut self, module: &str, parameters: &[Parameter]) -> Result<(), Failure> {
        let mut text = String::new();
        for parameter in parameters {
            let range = parameter.field.with_unit(&parameter.range());
            let _ = writeln!(text, "# {} ({})", one_line(&parameter.field.text), one_line(&range));
            let _ = writeln!(text, "{} = {}", key(&parameter.field.name), toml_text(&parameter.value()?));
        }
        self.modules.insert(module.to_owned(), text);
        Ok(())
    }

    /// Replaces the file atomically: a reader, also after a power cut, finds the old file or the new one.
    pub(super) fn write(&self, path: &Path, installation: &Installation) -> Result<(), Failure> {
        // The target of a symbolic link, so that the link stays.
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let told = |error: std::io::Error| format!("{} cannot be written: {error}", path.display());
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut file = tempfile::Builder::new().prefix(".parameters-").tempfile_in(folder).map_err(told)?;
        file.write_all(self.text(installation).as_bytes()).map_err(told)?;
        let permissions = std::fs::metadata(&path).map(|there| there.permissions());
        let permissions = permissions.unwrap_or_else(|_| std::os::unix::fs::PermissionsExt::from_mode(0o644));
        file.as_file().set_permissions(permissions).map_err(told)?;
        file.as_file().sync_all().map_err(told)?;
        file.persist(&path).map_err(|error| told(error.error))?;
        std::fs::File::open(folder).and_then(|folder| folder.sync_all()).map_err(told)?;
        Ok(())
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
            let _ = write!(text, "\n[{}]\n{values}", toml::Value::from(module.as_str()));
        }
        text
    }
}

fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
    if bare { name.into() } else { toml::Value::from(name).to_string() }
}

/// Text for a comment: a module's text must end with the line.
fn one_line(text: &str) -> Cow<'_, str> {
    plain::line(text)
}
