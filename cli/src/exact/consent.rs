//! What a recording would have run, in words, before the user decides: the command of a module, and what of it is
//! otherwise in the local configuration. Nothing runs here.

use super::command::ModuleCommand;
use super::journals::RecordedRun;
use crate::terminal::Failure;
use rohrpost_config::{Installation, Module};
use rohrpost_modules::journal::ExactRun;
use std::collections::BTreeSet;
use std::path::Path;

/// Characters of a value that are shown.
const VALUE_MAX: usize = 60;

/// The user's own configuration of the robot, if one is named.
pub(super) struct LocalConfiguration(Option<Installation>);

/// A command, and in lines what of the module is otherwise in the local configuration.
#[derive(Debug)]
pub(super) struct RecordedCommand {
    pub(super) command: ModuleCommand,
    pub(super) differences: Vec<String>,
}

impl LocalConfiguration {
    pub(super) fn load(path: Option<&Path>) -> Result<Self, Failure> {
        Ok(Self(path.map(Installation::load).transpose()?))
    }

    /// The command of a run as its recording has it.
    ///
    /// # Errors
    /// Why nothing of it is run.
    pub(super) fn compared(&self, run: &RecordedRun, exact: &ExactRun) -> Result<RecordedCommand, String> {
        let (recorded, name) = run.readable(exact)?;
        run.contradiction(&recorded).map_or(Ok(()), Err)?;
        let command = ModuleCommand::of(&recorded, name)?;
        let module = recorded.module(name).ok_or("the configuration does not have the module")?;
        let differences = self.differences(&run.module, (&recorded, module), Some(&command));
        Ok(RecordedCommand { command, differences })
    }

    /// What of a run's module is otherwise here, if another program than the recorded one runs: it is given what was
    /// recorded. Nothing without a local configuration.
    ///
    /// # Errors
    /// The recording does not say.
    pub(super) fn given(&self, run: &RecordedRun, exact: &ExactRun) -> Result<Vec<String>, String> {
        if self.0.is_none() {
            return Ok(Vec::new());
        }
        let (recorded, name) = run.readable(exact)?;
        let module = recorded.module(name).ok_or("the configuration does not have the module")?;
        Ok(self.differences(&run.module, (&recorded, module), None))
    }

    /// `command`: what would run as recorded, if that is to be compared.
    fn differences(
        &self,
        name: &str,
        (recorded, its): (&Installation, &Module),
        command: Option<&ModuleCommand>,
    ) -> Vec<String> {
        let Some(local) = &self.0 else {
            return vec!["no local configuration to compare with; name one: --config FILE".into()];
        };
        let path = local.shown.display();
        let module = local.classes.parse_module(name).ok().and_then(|name| local.module(name));
        let Some(module) = module else { return vec![format!("{path} has no module {name}")] };
        let mut lines = Vec::new();
        if let Some(command) = command {
            match ModuleCommand::of(local, module.name) {
                Ok(own) if own == *command => {}
                Ok(own) => lines.push(format!("{path} has another command: {own}")),
                Err(why) => lines.push(format!("{path}: {why}")),
            }
        }
        let settings = other_values(&its.settings, &module.settings);
        lines.extend(settings.map(|others| format!("{path} has other settings: {others}")));
        let parameters = other_values(&saved_values(recorded, its), &saved_values(local, module));
        lines.extend(parameters.map(|others| format!("{path} has other saved parameters: {others}")));
        if lines.is_empty() {
            lines.push(format!("the same as in {path}"));
        }
        lines
    }
}

/// The saved parameters of a module. All that reads as TOML is a value.
fn saved_values(installation: &Installation, module: &Module) -> toml::Table {
    let document = installation.document();
    let values = document.saved().and_then(|saved| saved.values(module.name).ok()).unwrap_or_default();
    values.into_iter().map(|saved| (saved.name, saved.value)).collect()
}

/// The values that differ, as they are here and were recorded; none if all are equal.
fn other_values(recorded: &toml::Table, local: &toml::Table) -> Option<String> {
    let keys = recorded.keys().chain(local.keys()).filter(|key| recorded.get(*key) != local.get(*key));
    let keys: BTreeSet<&String> = keys.collect();
    let shown = |value: Option<&toml::Value>| -> String {
        let text = value.map_or_else(|| "nothing".into(), ToString::to_string);
        match text.char_indices().nth(VALUE_MAX) {
            Some((end, _)) => format!("{} …", &text[..end]),
            None => text,
        }
    };
    let one = |key: &&String| {
        let (here, there) = (local.get(*key), recorded.get(*key));
        format!("{key} = {} (recorded: {})", shown(here), shown(there))
    };
    (!keys.is_empty()).then(|| keys.iter().map(one).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_config::Saved;

    /// A configuration with this program and these settings of its one module.
    fn config(module: &str, program: &str, settings: &str) -> Installation {
        let text = format!(
            "installation = \"test\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\npilot = {{ id = 140 }}\n\
             tool = {{ id = 16 }}\n[nodes.main]\n[[module]]\nname = \"{module}\"\nprogram = {program}\n\
             settings = {{ {settings} }}\n"
        );
        Installation::parse(&text, Path::new("/robot/robot.toml")).unwrap()
    }

    #[test]
    fn what_is_otherwise_in_the_local_configuration_is_told() {
        let recorded = config("pilot.0", "[\"/bin/sh\", \"-c\", \"x\"]", "seed = 1, speed = 2.0");
        let name = recorded.classes.parse_module("pilot.0").unwrap();
        let command = ModuleCommand::of(&recorded, name).unwrap();
        let told = |local: Option<Installation>| {
            LocalConfiguration(local).differences(
                "pilot.0",
                (&recorded, recorded.module(name).unwrap()),
                Some(&command),
            )
        };
        assert_eq!(told(None), ["no local configuration to compare with; name one: --config FILE"]);
        assert_eq!(told(Some(recorded.clone())), ["the same as in /robot/robot.toml"]);
        let other = config("pilot.0", "[\"/bin/sh\", \"-c\", \"y\"]", "seed = 1, speed = 3.0, new = 1");
        assert_eq!(
            told(Some(other)),
            [
                "/robot/robot.toml has another command: /bin/sh -c y",
                "/robot/robot.toml has other settings: new = 1 (recorded: nothing), speed = 3.0 (recorded: 2.0)"
            ]
        );
        let mut tuned = recorded.clone();
        let saved = "[\"pilot.0\"]\nspeed = 5.0\n";
        tuned.saved = Some(Saved::parse(saved, Path::new("/robot/tuned.toml"), &tuned).unwrap());
        assert_eq!(
            told(Some(tuned)),
            ["/robot/robot.toml has other saved parameters: speed = 5.0 (recorded: nothing)"]
        );
        let other = config("pilot.1", "\"x\"", "");
        assert_eq!(told(Some(other)), ["/robot/robot.toml has no module pilot.0"]);
    }
}
