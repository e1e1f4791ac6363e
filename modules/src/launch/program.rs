//! A module's program, and what its process is told by its environment.

use crate::runtime::environment;
use rohrpost_config::{Installation, Module, Program as Configured, find_program};
use std::io::{self, PipeWriter};
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// How a module's process is started.
pub(super) struct Program {
    path: PathBuf,
    arguments: Vec<String>,
    /// The configuration's file.
    config: PathBuf,
    /// The module's name.
    module: String,
    /// The standard input of all its processes, one after the other; none: there is nothing to read.
    kept: Option<OwnedFd>,
}

impl Program {
    /// `executable` is the `rohrpost` command, which holds the built-in modules.
    pub(super) fn new(module: &Module, installation: &Installation, executable: &Path, kept: Option<OwnedFd>) -> Self {
        let beside = executable.parent().unwrap_or(Path::new("."));
        let (path, arguments) = match &module.program {
            Configured::Builtin(name) if !module.is_in_file() => (executable.to_owned(), vec![name.clone()]),
            Configured::Builtin(name) => (executable.to_owned(), vec!["run".to_owned(), name.clone()]),
            Configured::Command(words) => {
                let program = words.first().map_or("", String::as_str);
                let found = find_program(program, &installation.folder, beside);
                (found.unwrap_or_else(|| program.into()), words.iter().skip(1).cloned().collect())
            }
        };
        let config = installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone());
        Self { path, arguments, config, module: installation.classes.format(module.name), kept }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Starts a process, in a process group of its own so that a Ctrl-C is launch's to handle. `on`: it switches itself on.
    pub(super) fn spawn(&self, on: bool, restarts: u32, [stdout, stderr]: [PipeWriter; 2]) -> io::Result<Child> {
        let mut command = Command::new(&self.path);
        if !on {
            command.env(environment::OFF, "1");
        }
        match &self.kept {
            Some(kept) => command.env(environment::KEPT, "1").stdin(kept.try_clone()?),
            None => command.env_remove(environment::KEPT).stdin(Stdio::null()),
        };
        // Launch alone speaks to the service manager.
        for variable in ["NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID", "JOURNAL_STREAM"] {
            command.env_remove(variable);
        }
        command
            .args(&self.arguments)
            .env(environment::CONFIG, &self.config)
            .env(environment::MODULE, &self.module)
            .env(environment::LAUNCHER, std::process::id().to_string())
            .env(environment::RESTARTS, restarts.to_string())
            .stdout(stdout)
            .stderr(stderr)
            .process_group(0)
            .spawn()
    }
}
