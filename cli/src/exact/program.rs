//! The program of a module, run with a journal and nothing else.

use super::journals::RecordedRun;
use crate::demo::{Folder, is_built_in, write_map};
use crate::quota::check_shared;
use crate::terminal::Failure;
use rohrpost_config::{Program, find_program};
use rohrpost_modules::journal::{ExactRun, ReplayReport, VARIABLE};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where shared memory is; a program that runs alone has its mailboxes and streams there, too.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Runs programs of recorded modules.
pub(super) struct ExactPrograms {
    program: Option<PathBuf>,
    folder: Option<PathBuf>,
    /// File with the records that journals name.
    records: Option<String>,
}

impl ExactPrograms {
    pub(super) fn new(program: Option<PathBuf>, folder: Option<PathBuf>, records: Option<PathBuf>) -> Self {
        Self { program, folder, records: records.map(|path| path.display().to_string()) }
    }

    /// Repeats a run, and reads what the program found.
    pub(super) fn repeat(&self, run: &RecordedRun) -> Result<ReplayReport, Failure> {
        let directory = Folder::within(Path::new(SHARED_MEMORY))?;
        let (file, report) = (directory.path().join("run"), directory.path().join("report"));
        let folder = self.folder.as_ref().map(|folder| canonical(folder)).transpose()?;
        let mut exact = ExactRun {
            folder: folder.map(|folder| folder.display().to_string()),
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
        let own = std::env::current_exe().map_err(|error| error.to_string())?;
        let module = installation.module(name).ok_or("the configuration does not have the module")?;
        check_shared(module.memory()).map_err(|error| error.to_string())?;
        let command = match (&self.program, &module.program) {
            (Some(program), Program::Command(words)) => {
                let mut command = Command::new(program);
                command.args(words.get(1..).unwrap_or_default());
                command
            }
            (program, Program::Builtin(builtin)) => {
                let mut command = Command::new(program.as_ref().unwrap_or(&own));
                command.args(["run", builtin]);
                command
            }
            (None, Program::Command(words)) => {
                let wanted = words.first().map_or("", String::as_str);
                let beside = own.parent().unwrap_or(Path::new("."));
                let found = find_program(wanted, &installation.folder, beside);
                let found =
                    found.ok_or_else(|| format!("its program `{wanted}` is not here; name one: --program PATH"))?;
                let mut command = Command::new(found);
                command.args(words.get(1..).unwrap_or_default());
                command
            }
        };
        Ok(command)
    }
}

/// Whether the folder of the configuration was the copy that a demo made of its own, and removed at its end.
fn is_of_demo(exact: &ExactRun) -> bool {
    exact.installation().is_ok_and(|(installation, _)| is_built_in(&installation.text) && !installation.folder.exists())
}

fn canonical(folder: &Path) -> Result<PathBuf, Failure> {
    Ok(folder.canonicalize().map_err(|error| format!("--folder {}: {error}", folder.display()))?)
}
