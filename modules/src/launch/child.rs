//! One module's process: started, watched, started again, stopped.

use super::leftovers::KILL_TIME;
use crate::runtime::{StartError, environment};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_config::{Installation, Module, Program, Restart, RestartPolicy, Start, find_program};
use rohrpost_mailbox::{ModuleState, Name, Node};
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest pause before a restart.
const BACKOFF_MAX: Duration = Duration::from_secs(10);
/// Lines of what a module printed that are kept to be told when it ends: a panic and its back trace.
const PRINTED_MAX: usize = 64;

/// When a process has ended, what it printed last is still on its way for moments; or for ever, if it left processes behind
/// that hold its pipe.
const PRINTED_WAIT: Duration = Duration::from_millis(100);

/// Where launch stands with a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Not started yet, or waiting to be started again.
    Waiting,
    /// Started, not ready.
    Starting,
    /// Ready, and not switched on yet.
    Ready,
    /// At work, or switched off by somebody.
    Running,
    /// Ended, and that was all right.
    Ended,
    /// Ended, and not to be started again.
    Failed(String),
}

/// A module and its process.
pub(super) struct Child {
    name: Name,
    text: String,
    arguments: Vec<String>,
    config: PathBuf,
    program: PathBuf,
    restart: Restart,
    start: Start,
    ready_within: Duration,
    stop_within: Duration,
    phase: Phase,
    process: Option<std::process::Child>,
    since: Instant,
    /// When it was started again, the last times.
    restarted: VecDeque<Instant>,
    restarts: u32,
    backoff: Duration,
    printed: Arc<Mutex<VecDeque<String>>>,
    /// Reads what the process prints.
    reader: Option<JoinHandle<()>>,
}

impl Child {
    pub(super) fn new(module: &Module, installation: &Installation, executable: &Path) -> Self {
        let beside = executable.parent().unwrap_or(Path::new("."));
        let (program, arguments) = match &module.program {
            Program::Builtin(name) => (executable.to_owned(), vec!["run".to_owned(), name.clone()]),
            Program::Command(words) => {
                let program = words.first().map_or("", String::as_str);
                let found = find_program(program, &installation.folder, beside);
                (found.unwrap_or_else(|| program.into()), words.iter().skip(1).cloned().collect())
            }
        };
        Self {
            name: module.name,
            text: installation.classes.format(module.name),
            arguments,
            config: installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone()),
            program,
            restart: module.restart,
            start: module.start,
            ready_within: module.ready_within,
            stop_within: module.stop_within,
            phase: Phase::Waiting,
            process: None,
            since: Instant::now(),
            restarted: VecDeque::new(),
            restarts: 0,
            backoff: module.restart.backoff,
            printed: Arc::default(),
            reader: None,
        }
    }

    pub(super) fn name(&self) -> Name {
        self.name
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn phase(&self) -> &Phase {
        &self.phase
    }

    pub(super) fn restarts(&self) -> u32 {
        self.restarts
    }

    pub(super) fn wants_on(&self) -> bool {
        self.start == Start::On
    }

    /// It has been switched on, or is not meant to be.
    pub(super) fn runs(&mut self) {
        self.phase = Phase::Running;
    }

    /// Starts the process, in a process group of its own so that a Ctrl-C is launch's to handle.
    pub(super) fn spawn(&mut self) {
        self.since = Instant::now();
        match self.try_spawn() {
            Ok((process, reader)) => {
                (self.process, self.reader) = (Some(process), Some(reader));
                self.phase = Phase::Starting;
            }
            Err(error) => self.phase = Phase::Failed(format!("{}: {error}", self.program.display())),
        }
    }

    fn try_spawn(&self) -> io::Result<(std::process::Child, JoinHandle<()>)> {
        let (reader, writer) = io::pipe()?;
        let printed = self.printed.clone();
        // First: a process without one would be a process that nobody watches.
        let keep = move || keep_last(reader, &printed);
        let reader = std::thread::Builder::new().name("printed".into()).spawn(keep)?;
        let process = Command::new(&self.program)
            .args(&self.arguments)
            .env(environment::CONFIG, &self.config)
            .env(environment::MODULE, &self.text)
            .env(environment::LAUNCHER, std::process::id().to_string())
            .env(environment::RESTARTS, self.restarts.to_string())
            .stdin(Stdio::null())
            .stdout(writer.try_clone()?)
            .stderr(writer)
            .process_group(0)
            .spawn()?;
        Ok((process, reader))
    }

    /// Looks after it; what there is to say.
    pub(super) fn step(&mut self, node: &Node, now: Instant) -> Option<String> {
        if let Some(process) = &mut self.process {
            match process.try_wait() {
                Ok(Some(status)) => {
                    self.process = None;
                    // Receivers look for what it left, and whoever sleeps on it wakes.
                    node.announce_death();
                    return Some(self.ended(status, now));
                }
                Ok(None) => {}
                Err(error) => return Some(format!("{}: {error}", self.text)),
            }
        }
        match self.phase {
            Phase::Starting if self.is_ready(node) => self.phase = Phase::Ready,
            Phase::Starting if now - self.since > self.ready_within => {
                let within = self.ready_within;
                self.kill(Signal::SIGKILL);
                // For its end, and then as its policy has it.
                self.phase = Phase::Waiting;
                return Some(format!("{} was not ready within {within:?}; killed", self.text));
            }
            Phase::Waiting if self.process.is_none() && now >= self.since => self.spawn(),
            _ => {}
        }
        None
    }

    fn is_ready(&self, node: &Node) -> bool {
        let pid = self.process.as_ref().map(std::process::Child::id);
        let ready = |state| !matches!(state, ModuleState::Starting | ModuleState::Stopping);
        node.participants().iter().any(|p| p.module == self.name && Some(p.pid) == pid && p.state.is_some_and(ready))
    }

    /// It has ended: again, or not, as its policy has it.
    fn ended(&mut self, status: ExitStatus, now: Instant) -> String {
        let how = match (status.code(), status.signal()) {
            (Some(code), _) => format!("ended with {code}"),
            (None, Some(signal)) => format!("was killed by signal {signal}"),
            (None, None) => "ended".to_owned(),
        };
        // Started again, it would find the same configuration.
        let misconfigured = status.code() == Some(i32::from(StartError::CONFIGURATION));
        let again = match self.restart.policy {
            _ if misconfigured => false,
            RestartPolicy::Never => false,
            RestartPolicy::OnFailure => !status.success(),
            RestartPolicy::Always => true,
        };
        let printed = self.take_printed();
        if !again {
            let how_ended = format!("{how}{printed}");
            self.phase = if status.success() { Phase::Ended } else { Phase::Failed(how_ended.clone()) };
            return format!("{} {how_ended}", self.text);
        }
        self.restarted.push_back(now);
        self.restarted.retain(|at| now - *at <= self.restart.within);
        if self.restarted.len() > self.restart.at_most as usize {
            let Restart { at_most, within, .. } = self.restart;
            let why = format!("{how}; given up after {at_most} restarts within {within:?}{printed}");
            self.phase = Phase::Failed(why.clone());
            return format!("{} {why}", self.text);
        }
        // Alone for a while, it begins with the short pause again.
        if self.restarted.len() == 1 {
            self.backoff = self.restart.backoff;
        }
        let pause = self.backoff;
        self.backoff = (self.backoff * 2).min(BACKOFF_MAX);
        self.restarts += 1;
        self.phase = Phase::Waiting;
        self.since = now + pause;
        format!("{} {how}; starts again in {pause:?}{printed}", self.text)
    }

    fn take_printed(&mut self) -> String {
        let deadline = Instant::now() + PRINTED_WAIT;
        while self.reader.as_ref().is_some_and(|reader| !reader.is_finished()) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.reader = None;
        let mut printed = self.printed.lock().unwrap_or_else(PoisonError::into_inner);
        printed.drain(..).map(|line| format!("\n    {line}")).collect()
    }

    fn kill(&self, signal: Signal) {
        if let Some(process) = &self.process {
            // Not reaped yet, so the number still is this child's.
            let _ = kill(Pid::from_raw(process.id() as i32), signal);
        }
    }

    /// Stops it: by word, then by force. What there is to say.
    pub(super) fn stop(&mut self, node: &Node) -> Option<String> {
        self.kill(Signal::SIGTERM);
        let deadline = Instant::now() + self.stop_within;
        let mut killed = None;
        while let Some(process) = &mut self.process {
            match process.try_wait() {
                Ok(None) if killed.is_some() && Instant::now() >= deadline + KILL_TIME => {
                    // It waits for broken hardware, say. The others still have to be stopped.
                    killed =
                        Some(format!("{} (process {}) cannot even be killed; left behind", self.text, process.id()));
                    break;
                }
                Ok(None) if Instant::now() < deadline || killed.is_some() => {
                    std::thread::sleep(Duration::from_millis(2));
                }
                Ok(None) => {
                    let within = self.stop_within;
                    // A stopped process obeys this one too.
                    self.kill(Signal::SIGKILL);
                    killed = Some(format!("{} did not stop within {within:?}; killed", self.text));
                }
                Ok(Some(_)) | Err(_) => self.process = None,
            }
        }
        node.announce_death();
        self.phase = Phase::Ended;
        killed
    }
}

/// Keeps the last lines that come through a pipe, until it closes.
fn keep_last(pipe: PipeReader, printed: &Mutex<VecDeque<String>>) {
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    while let Ok(1..) = io::Read::take(&mut pipe, 4096).read_until(b'\n', &mut line) {
        let mut printed = printed.lock().unwrap_or_else(PoisonError::into_inner);
        if printed.len() == PRINTED_MAX {
            printed.pop_front();
        }
        printed.push_back(String::from_utf8_lossy(&line).trim_end().to_owned());
        line.clear();
    }
}
