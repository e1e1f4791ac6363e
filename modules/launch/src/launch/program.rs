//! A module's program, and what its process is told by its environment.

use rohrpost_config::{Installation, MissingProgram, Module, Program as Configured, Scheduling, find_program};
use rohrpost_mailbox::sys;
use rohrpost_modules::launch_support::environment;
use std::io::{self, PipeWriter};
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

/// Asked before each start of a program, with its path: an error keeps it from being started.
pub type Permit = Arc<dyn Fn(&Path) -> io::Result<()> + Send + Sync>;

/// Where launch has the right to it, it goes before ordinary programs by so much: on a busy computer a router that died
/// is to be there again before calls that wait for it run out of time.
const NICE: i8 = -15;

/// From now on the calling thread, which starts modules, goes before ordinary programs, if it may: then with its usual
/// niceness, which modules that are not real time begin with. A launch that was started to give way does so.
pub(super) fn hurry() -> Option<i8> {
    let Ok(sys::Scheduling::Normal(usual)) = sys::scheduling() else { return None };
    let may = (NICE + 1..=0).contains(&usual) && sys::schedule(sys::Scheduling::Normal(NICE)).is_ok();
    may.then_some(usual)
}

/// Where the program of a command is; its bare name if it is nowhere.
fn found(words: &[String], installation: &Installation, beside: &Path) -> PathBuf {
    let program = words.first().map_or("", String::as_str);
    find_program(program, &installation.folder, beside).unwrap_or_else(|| program.into())
}

/// How a module's process is started.
pub(super) struct Program {
    path: PathBuf,
    /// The folder of the `rohrpost` command, where a bare name is looked for first.
    beside: PathBuf,
    arguments: Vec<String>,
    /// The configuration's file.
    config: PathBuf,
    /// The module's name, and its node.
    module: String,
    node: String,
    /// The last of `kept` tell the process that its lease begins, and ends.
    is_leased: bool,
    /// What all its processes have, one after the other.
    kept: Vec<OwnedFd>,
    /// What it begins with, if launch goes before ordinary programs and it is not real time.
    nice: Option<i8>,
    permit: Permit,
}

impl Program {
    /// `executable` is the `rohrpost` command, which holds the built-in modules.
    /// `usual_nice`: what [`hurry`] has given.
    pub(super) fn new(
        module: &Module,
        installation: &Installation,
        executable: &Path,
        kept: Vec<OwnedFd>,
        usual_nice: Option<i8>,
        permit: &Permit,
    ) -> Self {
        let beside = executable.parent().unwrap_or(Path::new(".")).to_owned();
        let (path, arguments) = match &module.program {
            Configured::Builtin(name) if !module.is_in_file() => (executable.to_owned(), vec![name.clone()]),
            Configured::Builtin(name) => (executable.to_owned(), vec!["run".to_owned(), name.clone()]),
            Configured::Command(words) => {
                (found(words, installation, &beside), words.iter().skip(1).cloned().collect())
            }
        };
        let config = installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone());
        let is_real_time = matches!(installation.scheduling(module.name.class()), Scheduling::Fifo { .. });
        let nice = usual_nice.filter(|_| !is_real_time);
        let (node, is_leased) = (module.node.clone(), module.has_standby());
        let (module, permit) = (installation.classes.format(module.name), permit.clone());
        Self { path, beside, arguments, config, module, node, is_leased, kept, nice, permit }
    }

    /// Looks again for a program that was missing.
    pub(super) fn look_again(&mut self, module: &Module, installation: &Installation) -> Result<(), MissingProgram> {
        if let Some(missing) = installation.missing_program(module, &self.beside) {
            return Err(missing);
        }
        if let Configured::Command(words) = &module.program {
            self.path = found(words, installation, &self.beside);
        }
        Ok(())
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Starts a process, in a process group of its own so that a Ctrl-C is launch's to handle. `on`: it switches itself
    /// on. `quiet`: for so long it keeps its lines of output to itself.
    pub(super) fn spawn(
        &self,
        on: bool,
        restarts: u32,
        quiet: Option<Duration>,
        [stdout, stderr]: [PipeWriter; 2],
    ) -> io::Result<Child> {
        (self.permit)(&self.path)?;
        let mut command = Command::new(&self.path);
        match quiet {
            Some(quiet) => command.env(environment::QUIET_MS, quiet.as_millis().to_string()),
            None => command.env_remove(environment::QUIET_MS),
        };
        if !on {
            command.env(environment::OFF, "1");
        }
        match self.is_leased {
            true => command.env(environment::LEASE, "1"),
            false => command.env_remove(environment::LEASE),
        };
        match self.kept.is_empty() {
            true => sys::hand_nothing_on(&mut command),
            false => sys::hand_on(&mut command, &self.kept)?,
        }
        // Launch alone speaks to the service manager.
        for variable in ["NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID", "JOURNAL_STREAM"] {
            command.env_remove(variable);
        }
        command
            .args(&self.arguments)
            .stdin(Stdio::null())
            .env(environment::CONFIG, &self.config)
            .env(environment::MODULE, &self.module)
            .env(environment::NODE, &self.node)
            .env(environment::LAUNCHER, std::process::id().to_string())
            .env(environment::RESTARTS, restarts.to_string())
            .stdout(stdout)
            .stderr(stderr)
            .process_group(0);
        let Some(nice) = self.nice else { return command.spawn() };
        // It inherits the niceness of this thread.
        sys::schedule(sys::Scheduling::Normal(nice))?;
        let spawned = command.spawn();
        let _ = sys::schedule(sys::Scheduling::Normal(NICE));
        spawned
    }
}
