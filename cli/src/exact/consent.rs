//! What a recording would have run, in words, before the user decides: the command of a module, and what of it is
//! otherwise in the local configuration. Nothing runs here.

use super::command::ModuleCommand;
use super::journals::RecordedRun;
use crate::terminal::Failure;
use rohrpost_config::{Installation, Module};
use rohrpost_modules::journal::ExactRun;
use std::collections::BTreeSet;
use std::path::Path;

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
        let differences = self.differences(&run.module, module, &command);
        Ok(RecordedCommand { command, differences })
    }

    fn differences(&self, name: &str, recorded: &Module, command: &ModuleCommand) -> Vec<String> {
        let Some(local) = &self.0 else {
            return vec!["no local configuration to compare with; name one: --config FILE".into()];
        };
        let path = local.shown.display();
        let module = local.classes.parse_module(name).ok().and_then(|name| local.module(name));
        let Some(module) = module else { return vec![format!("{path} has no module {name}")] };
        let mut lines = Vec::new();
        match ModuleCommand::of(local, module.name) {
            Ok(own) if own == *command => {}
            Ok(own) => lines.push(format!("{path} has another command: {own}")),
            Err(why) => lines.push(format!("{path}: {why}")),
        }
        let (one, other) = (&recorded.settings, &module.settings);
        let keys = one.keys().chain(other.keys()).filter(|key| one.get(*key) != other.get(*key));
        let keys: BTreeSet<&str> = keys.map(String::as_str).collect();
        if !keys.is_empty() {
            let keys = keys.into_iter().collect::<Vec<_>>().join(", ");
            lines.push(format!("{path} has other settings: {keys}"));
        }
        if lines.is_empty() {
            lines.push(format!("the same as in {path}"));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            LocalConfiguration(local).differences("pilot.0", recorded.module(name).unwrap(), &command)
        };
        assert_eq!(told(None), ["no local configuration to compare with; name one: --config FILE"]);
        assert_eq!(told(Some(recorded.clone())), ["the same as in /robot/robot.toml"]);
        let other = config("pilot.0", "[\"/bin/sh\", \"-c\", \"y\"]", "seed = 1, speed = 3.0, new = 1");
        assert_eq!(
            told(Some(other)),
            ["/robot/robot.toml has another command: /bin/sh -c y", "/robot/robot.toml has other settings: new, speed"]
        );
        let other = config("pilot.1", "\"x\"", "");
        assert_eq!(told(Some(other)), ["/robot/robot.toml has no module pilot.0"]);
    }
}
