//! What one built-in module would refuse of its settings, its aliases and what it calls.

use rohrpost_config::{Document, Installation, Module as Configured, Problem, SettingsError};
use rohrpost_modules::Module;
use rohrpost_modules::interface::Interfaces;
use serde::de::DeserializeOwned;

/// Settings of a built-in module, as they are looked at before it runs.
pub(super) trait Settings: DeserializeOwned {
    /// Values that the module would refuse.
    ///
    /// # Errors
    /// Says which, and what would be right.
    fn check(&self) -> Result<(), RefusedSetting> {
        Ok(())
    }

    /// Settings that may change while it runs.
    fn parameters(&self) -> Vec<&str> {
        Vec::new()
    }

    /// Records that it writes, of the streams that may need larger ones than the default.
    fn recorded(&self) -> Vec<Recorded> {
        Vec::new()
    }

    /// Modules that it calls.
    fn calls(&self) -> Vec<Called<'_>> {
        Vec::new()
    }
}

/// A value that the module refuses.
#[derive(Debug, thiserror::Error)]
#[error("`{key}` {why}")]
pub(super) struct RefusedSetting {
    /// Key of the setting.
    pub(super) key: &'static str,
    /// What it is, and what it should be.
    pub(super) why: String,
}

/// Largest record of a stream.
pub(super) struct Recorded {
    /// Class of the interface that has the stream.
    pub(super) class: &'static str,
    /// The stream's name.
    pub(super) stream: &'static str,
    /// Bytes that it may have.
    pub(super) bytes: usize,
}

/// A module that a setting names.
pub(super) struct Called<'a> {
    /// Key of the setting.
    pub(super) key: &'static str,
    /// The module, as the file names it.
    pub(super) module: &'a str,
    /// Class of the interface that is called.
    pub(super) class: &'static str,
}

/// What a built-in module would refuse of the values that were saved of its parameters.
pub(super) fn saved<M: Module<Settings: Settings>>(
    document: &Document<'_>,
    module: &Configured,
) -> Option<SettingsError> {
    let settings: M::Settings = document.settings_without_saved(module).ok()?;
    let names = document.saved()?.check_names(module, &settings.parameters());
    names.and_then(|()| document.settings_as::<M::Settings>(module).map(drop)).err()
}

/// What a built-in module would refuse.
pub(super) fn module<M: Module<Settings: Settings>>(document: &Document<'_>, module: &Configured) -> Vec<Problem> {
    let installation = document.installation();
    let what = format!("module `{}`", installation.classes.format(module.name));
    let mut problems = aliases::<M>(installation, module, &what);
    let settings: M::Settings = match document.settings_without_saved(module) {
        Ok(settings) => settings,
        Err(error) => {
            let message = format!("{what}: settings: {}", error.message);
            problems.push(Problem { line: Some(error.text_line), message });
            return problems;
        }
    };
    if let Err(error) = settings.check() {
        let line = Some(document.settings_line(module, error.key));
        problems.push(Problem { line, message: format!("{what}: settings: {error}") });
    }
    for recorded in settings.recorded() {
        problems.extend(
            small_record(installation, module, &recorded)
                .map(|message| Problem { line: Some(module.line), message: format!("{what}: {message}") }),
        );
    }
    for called in settings.calls() {
        problems.extend(wrong_call(installation, module, &called).map(|message| Problem {
            line: Some(document.settings_line(module, called.key)),
            message: format!("{what}: settings: `{}` {message}", called.key),
        }));
    }
    problems
}

/// Names that the module answers to have interfaces.
fn aliases<M: Module>(installation: &Installation, module: &Configured, what: &str) -> Vec<Problem> {
    let known: Vec<&str> = M::Interfaces::table().iter().map(|served| served.class).collect();
    let mut problems = Vec::new();
    for alias in &module.aliases {
        let class = installation.classes.name(alias.class()).unwrap_or_default();
        if !known.contains(&class) {
            let right = match &known[..] {
                [] => "it has none; drop it from `aliases`".into(),
                known => format!("it has {}", known.join(", ")),
            };
            let alias = installation.classes.format(*alias);
            let message = format!("{what}: alias `{alias}`: the builtin has no interface of class `{class}`; {right}");
            problems.push(Problem { line: Some(module.line), message });
        }
    }
    problems
}

/// Whether a module has a name of this class, its own or an alias.
pub(super) fn has_class(installation: &Installation, module: &Configured, class: &str) -> bool {
    let id = installation.classes.id(class);
    module.names().any(|name| Some(name.class()) == id)
}

fn small_record(installation: &Installation, module: &Configured, recorded: &Recorded) -> Option<String> {
    let Recorded { class, stream, bytes } = *recorded;
    let takes = module.streams.get(stream).copied().unwrap_or_default().record_bytes;
    let is_small = has_class(installation, module, class) && bytes > takes as usize;
    is_small.then(|| {
        let right = bytes.div_ceil(1024);
        format!(
            "stream `{stream}` has records of up to {bytes} bytes, and takes {takes}; write `record = \"{right} KiB\"` \
             or more in [module.stream.{stream}]"
        )
    })
}

fn wrong_call(installation: &Installation, module: &Configured, called: &Called<'_>) -> Option<String> {
    let text = called.module;
    let name = match installation.classes.parse_module(text) {
        Ok(name) => name,
        Err(error) => return Some(format!("names no module: {error}")),
    };
    if installation.classes.name(name.class()) != Some(called.class) {
        return Some(format!("is `{text}`, but this module calls functions of class `{}`", called.class));
    }
    if installation.module(name).is_none() {
        return Some(format!("is `{text}`, which no [[module]] defines; add one, or name another"));
    }
    let declared = module.calls.contains(&name);
    (!declared).then(|| format!("is `{text}`, which `calls` does not name; add \"{text}\" to `calls`"))
}
