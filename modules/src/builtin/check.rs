//! What built-in modules would refuse of a configuration, told before anything runs. The crate `config` knows no modules,
//! so it is here that both meet.

use super::{Builtin, description};
use crate::interface::Interfaces;
use crate::module::Module;
use rohrpost_config::{Installation, Module as Configured, Problem, Program, SettingsError, Show, nearest};
use serde::de::DeserializeOwned;

/// Settings of a built-in module, as they are looked at before it runs.
pub(super) trait Settings: DeserializeOwned {
    /// Values that the module would refuse.
    ///
    /// # Errors
    /// Says which, and what would be right.
    fn check(&self) -> Result<(), Refused> {
        Ok(())
    }

    /// Those that may change while it runs.
    fn parameters(&self) -> &'static [&'static str] {
        &[]
    }

    /// Modules that it calls.
    fn calls(&self) -> Vec<Called<'_>> {
        Vec::new()
    }
}

/// A value that the module refuses.
#[derive(Debug, thiserror::Error)]
#[error("`{key}` {why}")]
pub(super) struct Refused {
    /// Key of the setting.
    pub(super) key: &'static str,
    /// What it is, and what it should be.
    pub(super) why: String,
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

/// Everything that built-in modules would refuse, by their settings, by what they call and by what the GUI is to show of
/// them. What programs of one's own would refuse only they know.
pub fn check(installation: &Installation) -> Vec<Problem> {
    let mut problems = Vec::new();
    for module in &installation.modules {
        let Program::Builtin(name) = &module.program else { continue };
        problems.extend(Builtin::find(name).map(|builtin| (builtin.check)(installation, module)).unwrap_or_default());
    }
    problems.extend(installation.gui.show.iter().filter_map(|show| data_of(installation, show)));
    problems
}

/// Everything that built-in modules would refuse of the values that were saved of their parameters, by line of that file.
pub fn check_saved(installation: &Installation) -> Vec<Problem> {
    let wrong = installation.modules.iter().filter_map(|module| {
        let Program::Builtin(name) = &module.program else { return None };
        let error = (Builtin::find(name)?.check_saved)(installation, module)?;
        Some(Problem { line: Some(error.line), message: format!("[\"{}\"]: {}", error.module, error.message) })
    });
    wrong.collect()
}

/// What a built-in module would refuse of the values that were saved of its parameters.
pub(super) fn saved<M: Module<Settings: Settings>>(
    installation: &Installation,
    module: &Configured,
) -> Option<SettingsError> {
    let saved = installation.saved.as_ref()?;
    let settings: M::Settings = installation.settings_without_saved(module).ok()?;
    let names = saved.check_names(installation, module, settings.parameters());
    names.and_then(|()| installation.settings_as::<M::Settings>(module).map(drop)).err()
}

/// What a built-in module would refuse.
pub(super) fn module<M: Module<Settings: Settings>>(installation: &Installation, module: &Configured) -> Vec<Problem> {
    let what = format!("module `{}`", installation.classes.format(module.name));
    let mut problems = faces::<M>(installation, module, &what);
    let settings: M::Settings = match installation.settings_without_saved(module) {
        Ok(settings) => settings,
        Err(error) => {
            let message = format!("{what}: settings: {}", error.message);
            problems.push(Problem { line: Some(error.line), message });
            return problems;
        }
    };
    if let Err(error) = settings.check() {
        let line = Some(installation.settings_line(module, error.key));
        problems.push(Problem { line, message: format!("{what}: settings: {error}") });
    }
    for called in settings.calls() {
        problems.extend(wrong_call(installation, module, &called).map(|message| Problem {
            line: Some(installation.settings_line(module, called.key)),
            message: format!("{what}: settings: `{}` {message}", called.key),
        }));
    }
    problems
}

/// Names that the module answers to have interfaces.
fn faces<M: Module>(installation: &Installation, module: &Configured, what: &str) -> Vec<Problem> {
    let known: Vec<&str> = M::Interfaces::table().iter().map(|served| served.class).collect();
    let mut problems = Vec::new();
    for face in &module.faces {
        let class = installation.classes.name(face.class()).unwrap_or_default();
        if !known.contains(&class) {
            let right = match &known[..] {
                [] => "it has none; drop it from `faces`".into(),
                known => format!("it has {}", known.join(", ")),
            };
            let face = installation.classes.format(*face);
            let message = format!("{what}: face `{face}`: the builtin has no interface of class `{class}`; {right}");
            problems.push(Problem { line: Some(module.line), message });
        }
    }
    problems
}

fn wrong_call(installation: &Installation, module: &Configured, called: &Called<'_>) -> Option<String> {
    let text = called.module;
    let name = match installation.classes.parse_module(text) {
        Ok(name) => name,
        Err(error) => return Some(format!("names no module: {error}")),
    };
    if installation.classes.name(name.class()) != Some(called.class) {
        return Some(format!("is `{text}`, but must be of class `{}`, whose functions it calls", called.class));
    }
    if installation.module(name).is_none() {
        return Some(format!("is `{text}`, which no [[module]] defines; add one, or name another"));
    }
    let declared = module.calls.contains(&name);
    (!declared).then(|| format!("is `{text}`, which `calls` does not name; add \"{text}\" to `calls`"))
}

/// What the GUI is to show of a built-in module, and that has no such data.
fn data_of(installation: &Installation, show: &Show) -> Option<Problem> {
    let module = installation.module(show.from)?;
    let class = installation.classes.name(show.from.class())?;
    let Program::Builtin(builtin) = &module.program else { return None };
    let description = description(builtin, class)?;
    let data = show.data.as_ref()?;
    if description.data_item(data).is_some() {
        return None;
    }
    let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
    let right = match (nearest(data, names.iter().copied()), &names[..]) {
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, []) => "it publishes none; drop the entry".into(),
        (None, names) => format!("it has {}", names.join(", ")),
    };
    let from = installation.classes.format(show.from);
    Some(Problem { line: Some(show.line), message: format!("[gui] show: `{from}` has no data `{data}`; {right}") })
}
