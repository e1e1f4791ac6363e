//! What runs as a module, as a configuration says it.

use crate::command_line::command_line;
use rohrpost_config::{Installation, Program, find_program, may_have_journal};
use rohrpost_mailbox::Name;
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A program and its arguments. Shown, it is one line, quoted and escaped.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct ModuleCommand {
    /// Where it was found; as the configuration names it, if it is not here.
    program: PathBuf,
    arguments: Vec<String>,
    is_here: bool,
}

impl ModuleCommand {
    /// That of a module.
    ///
    /// # Errors
    /// The configuration does not have it, or it is one of those without a journal: those would open and write what the
    /// configuration names.
    pub(super) fn of(installation: &Installation, name: Name) -> Result<Self, String> {
        let module = installation.module(name).ok_or("the configuration does not have the module")?;
        let own = std::env::current_exe().map_err(|error| error.to_string())?;
        match &module.program {
            Program::Builtin(builtin) if !may_have_journal(&module.program) => {
                Err(format!("the built-in `{builtin}` has no journal, so this one is not of it; nothing runs"))
            }
            Program::Builtin(builtin) => {
                Ok(Self { program: own, arguments: vec!["run".into(), builtin.clone()], is_here: true })
            }
            Program::Command(words) => {
                let (wanted, arguments) = words.split_first().ok_or("the configuration names no program")?;
                let beside = own.parent().unwrap_or(Path::new("."));
                let found = find_program(wanted, &installation.folder, beside);
                let is_here = found.is_some();
                let program = found.unwrap_or_else(|| wanted.into());
                Ok(Self { program, arguments: arguments.to_vec(), is_here })
            }
        }
    }

    /// Its words.
    pub(super) fn words(&self) -> impl Iterator<Item = &OsStr> {
        std::iter::once(self.program.as_os_str()).chain(self.arguments.iter().map(OsStr::new))
    }

    /// Ready to be run.
    ///
    /// # Errors
    /// Its program is not here.
    pub(super) fn prepared(&self) -> Result<Command, String> {
        if !self.is_here {
            return Err(format!("its program `{}` is not here; name one: --program PATH", self.program.display()));
        }
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        Ok(command)
    }
}

impl fmt::Display for ModuleCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&command_line(self.words()))?;
        if self.is_here { Ok(()) } else { f.write_str("   (its program is not here)") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
pilot = { id = 140 }
logd = { id = 24 }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "pilot.0"
builtin = "pilot"
[[module]]
name = "pilot.1"
program = ["/bin/sh", "-c", "touch ran\n"]
[[module]]
name = "pilot.2"
program = ["./nowhere/pilot", "-v"]
[[module]]
name = "logd.0"
builtin = "logd"
[record]
directory = "/tmp/elsewhere"
"#;

    #[test]
    fn a_command_is_whole_and_what_has_no_journal_has_none() {
        let installation = Installation::parse(CONFIG, Path::new("robot.toml")).unwrap();
        let of = |name: &str| ModuleCommand::of(&installation, installation.classes.parse_module(name).unwrap());
        assert!(of("pilot.0").unwrap().to_string().ends_with(" run pilot"));
        assert_eq!(of("pilot.1").unwrap().to_string(), r"/bin/sh -c $'touch ran\n'");
        let away = of("pilot.2").unwrap();
        assert_eq!(away.to_string(), "./nowhere/pilot -v   (its program is not here)");
        assert!(away.prepared().is_err_and(|why| why.contains("`./nowhere/pilot` is not here; name one: --program")));
        assert!(of("logd.0").is_err_and(|why| why.contains("the built-in `logd` has no journal")));
    }
}
