//! The program of a module, run with a journal and nothing else.

use super::command::ModuleCommand;
use super::journals::RecordedRun;
use crate::begin::demo::{Folder, is_built_in, write_map};
use crate::quota::check_shared;
use crate::terminal::Failure;
use rohrpost_modules::journal::{ExactRun, ReplayReport, VARIABLE};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where shared memory is; a program that runs alone has its mailboxes and streams there, too.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Which program repeats the runs.
pub(crate) enum ExactProgram {
    /// This command of the user's, whole: no word of it is the recording's.
    Given { program: PathBuf, arguments: Vec<OsString> },
    /// That of the recording, for which the user asked.
    Recorded,
}

/// Runs programs of recorded modules.
pub(super) struct ExactPrograms<'a> {
    pub(super) program: &'a ExactProgram,
    /// What stands for the folder of the configuration.
    pub(super) folder: Option<String>,
    /// File with the records that journals name.
    pub(super) records: Option<String>,
}

impl ExactPrograms<'_> {
    /// Repeats a run, and reads what the program found.
    pub(super) fn repeat(&self, run: &RecordedRun) -> Result<ReplayReport, Failure> {
        let directory = Folder::within(Path::new(SHARED_MEMORY))?;
        let (file, report) = (directory.path().join("run"), directory.path().join("report"));
        let mut exact = ExactRun {
            folder: self.folder.clone(),
            report: report.display().to_string(),
            records: self.records.clone(),
            ..run.exact()
        };
        if self.folder.is_none() && is_of_demo(&exact) {
            write_map(directory.path())?;
            exact.folder = Some(directory.path().display().to_string());
        }
        let mut command = match self.command(run, &exact) {
            Ok(command) => command,
            Err(why) => return Ok(ReplayReport::refused(why)),
        };
        exact.save(&file)?;
        let status = command
            .env(VARIABLE, &file)
            .env("ROHRPOST_DIR", directory.path().join("nodes"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status()
            .map_err(|error| format!("{}: {error}", command.get_program().display()))?;
        let report = std::fs::read(&report).ok().and_then(|bytes| ReplayReport::from_bytes(&bytes));
        Ok(report.unwrap_or_else(|| ReplayReport::refused(format!("its program ended ({status}) and told no result"))))
    }

    fn command(&self, run: &RecordedRun, exact: &ExactRun) -> Result<Command, String> {
        let (installation, name) = run.installation(exact)?;
        let module = installation.module(name).ok_or("the configuration does not have the module")?;
        check_shared(module.memory()).map_err(|error| error.to_string())?;
        match self.program {
            ExactProgram::Given { program, arguments } => {
                let mut command = Command::new(program);
                command.args(arguments);
                Ok(command)
            }
            ExactProgram::Recorded => {
                run.contradiction(&installation).map_or(Ok(()), Err)?;
                ModuleCommand::of(&installation, name)?.prepared()
            }
        }
    }
}

/// Whether the folder of the configuration was the copy that a demo made of its own, and removed at its end.
fn is_of_demo(exact: &ExactRun) -> bool {
    exact.installation().is_ok_and(|(installation, _)| is_built_in(&installation.text) && !installation.folder.exists())
}
