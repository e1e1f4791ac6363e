//! One module's process: started, watched, started again, stopped. Nothing here waits: each step looks, and says when to
//! look again.

use super::control::{ChildState, Phase};
use super::leftovers::KILL_TIME;
use super::policy::{Next, Policy};
use super::printed::Printed;
use crate::output::Relay;
use crate::runtime::{StartError, environment};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_config::{Installation, Module, Program, Restart, Start, find_program};
use rohrpost_mailbox::{ModuleState, Name, Node};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// While a module starts or ends it is looked after so often.
const LOOK: Duration = Duration::from_millis(5);
/// When a process has ended, what it printed last is still on its way for moments; or for ever, if it left processes behind
/// that hold its pipe.
const PRINTED_WAIT: Duration = Duration::from_millis(100);
/// Bytes of a text that are told to tools.
const TOLD_MAX: usize = 1000;

/// What becomes of a module that is told to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Then {
    /// It stays ended until somebody starts it.
    Stay,
    /// It is started again.
    Start,
    /// It is launch that ends.
    End,
}

/// A process on its way to its end.
struct Ending {
    then: Then,
    /// When it was told.
    since: Instant,
    /// When it was killed, since it did not obey.
    killed: Option<Instant>,
    /// Not even that helped.
    left_behind: bool,
}

/// A module and its process.
pub(super) struct Child {
    name: Name,
    text: String,
    arguments: Vec<String>,
    config: PathBuf,
    program: PathBuf,
    policy: Policy,
    /// Whether it is switched on when it is ready.
    turn_on: bool,
    configured_on: bool,
    ready_within: Duration,
    stop_within: Duration,
    phase: Phase,
    process: Option<std::process::Child>,
    /// Its process has ended so, then; what it printed last may still come.
    over: Option<(ExitStatus, Instant)>,
    ending: Option<Ending>,
    /// It was started then, or will be.
    since: Instant,
    /// Processes it has had.
    lives: u32,
    /// How often its policy started it again.
    restarts: u32,
    /// How it ended, and what it had printed; empty if it never did.
    last_end: String,
    printed: Printed,
    /// Launch ends: nothing is started any more.
    last_life: bool,
}

impl Child {
    pub(super) fn new(module: &Module, installation: &Installation, executable: &Path, relay: &Relay) -> Self {
        let beside = executable.parent().unwrap_or(Path::new("."));
        let (program, arguments) = match &module.program {
            Program::Builtin(name) => (executable.to_owned(), vec!["run".to_owned(), name.clone()]),
            Program::Command(words) => {
                let program = words.first().map_or("", String::as_str);
                let found = find_program(program, &installation.folder, beside);
                (found.unwrap_or_else(|| program.into()), words.iter().skip(1).cloned().collect())
            }
        };
        let configured_on = module.start == Start::On;
        Self {
            name: module.name,
            text: installation.classes.format(module.name),
            arguments,
            config: installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone()),
            program,
            policy: Policy::new(module.restart),
            turn_on: configured_on,
            configured_on,
            ready_within: module.ready_within,
            stop_within: module.stop_within,
            phase: Phase::Waiting,
            process: None,
            over: None,
            ending: None,
            since: Instant::now(),
            lives: 0,
            restarts: 0,
            last_end: String::new(),
            printed: Printed::new(relay.voice(installation, module.name)),
            last_life: false,
        }
    }

    pub(super) fn name(&self) -> Name {
        self.name
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn phase(&self) -> Phase {
        self.phase
    }

    pub(super) fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Processes it has had.
    pub(super) fn lives(&self) -> u32 {
        self.lives
    }

    /// Whether it is there, or on its way, and meant to stay.
    pub(super) fn is_at_work(&self) -> bool {
        let running = matches!(self.phase, Phase::Starting | Phase::Ready | Phase::Running);
        running && self.process.is_some()
    }

    /// How it ended the last time, and what it had printed.
    pub(super) fn last_end(&self) -> &str {
        &self.last_end
    }

    pub(super) fn wants_on(&self) -> bool {
        self.turn_on
    }

    /// It has been switched on, or is not meant to be.
    pub(super) fn runs(&mut self) {
        self.phase = Phase::Running;
    }

    /// As tools are told.
    pub(super) fn state(&self, now: Instant) -> ChildState {
        let waits = self.phase == Phase::Waiting && self.process.is_none() && self.lives > 0;
        ChildState {
            module: self.text.clone(),
            phase: self.phase,
            pid: self.process.as_ref().map(std::process::Child::id),
            lives: self.lives,
            restarts: self.restarts,
            starts_in_ms: waits.then(|| self.since.saturating_duration_since(now).as_millis() as u32),
            last_end: cut(&self.last_end),
            printed: cut(&self.printed.last()),
        }
    }

    /// When it has to be looked after again, if no signal comes before.
    pub(super) fn look_again(&self, now: Instant) -> Option<Duration> {
        let attend = self.printed.attend_at().map(|at| at.saturating_duration_since(now));
        self.look_at_phase(now).into_iter().chain(attend).min()
    }

    fn look_at_phase(&self, now: Instant) -> Option<Duration> {
        match self.phase {
            _ if self.over.is_some() => Some(LOOK),
            Phase::Starting | Phase::Stopping => Some(LOOK),
            // Killed, since it did not get ready.
            Phase::Waiting if self.process.is_some() => Some(LOOK),
            Phase::Waiting if !self.last_life => Some(self.since.saturating_duration_since(now)),
            _ => None,
        }
    }

    /// Starts the process, in a process group of its own so that a Ctrl-C is launch's to handle.
    pub(super) fn spawn(&mut self) {
        self.since = Instant::now();
        match self.try_spawn() {
            Ok(process) => {
                self.process = Some(process);
                self.phase = Phase::Starting;
                self.lives += 1;
            }
            Err(error) => {
                self.last_end = format!("{}: {error}", self.program.display());
                self.phase = Phase::Failed;
            }
        }
    }

    fn try_spawn(&mut self) -> io::Result<std::process::Child> {
        // First: a process whose words nobody reads would be stuck at the first of them too many.
        let [stdout, stderr] = self.printed.begin()?;
        let mut command = Command::new(&self.program);
        // Of a module that has ended by itself others expect that it works, and what waits in its mailboxes comes before any
        // word of launch's: so it switches itself on. At the first start launch does, when all are ready.
        if self.lives == 0 || !self.turn_on {
            command.env(environment::OFF, "1");
        }
        // Launch alone speaks to the service manager.
        for variable in ["NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID", "JOURNAL_STREAM"] {
            command.env_remove(variable);
        }
        command
            .args(&self.arguments)
            .env(environment::CONFIG, &self.config)
            .env(environment::MODULE, &self.text)
            .env(environment::LAUNCHER, std::process::id().to_string())
            .env(environment::RESTARTS, self.restarts.to_string())
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(stderr)
            .process_group(0)
            .spawn()
    }

    /// Looks after it; what there is to say.
    pub(super) fn step(&mut self, node: &Node, now: Instant) -> Option<String> {
        self.printed.attend(now);
        if let Some(process) = &mut self.process {
            match process.try_wait() {
                Ok(Some(status)) => {
                    self.process = None;
                    self.over = Some((status, now));
                    // Receivers look for what it left, and whoever sleeps on it wakes.
                    node.announce_death();
                }
                Ok(None) => {}
                Err(error) => return Some(format!("{}: {error}", self.text)),
            }
        }
        if let Some((status, at)) = self.over {
            if !self.printed.is_complete() && now - at < PRINTED_WAIT {
                return None;
            }
            self.over = None;
            return self.ended(status, now);
        }
        match self.phase {
            Phase::Starting if self.state_of(node).is_some_and(is_ready) => self.phase = Phase::Ready,
            Phase::Starting if now - self.since > self.ready_within => {
                let within = self.ready_within;
                self.kill(Signal::SIGKILL);
                // For its end, and then as its policy has it.
                self.phase = Phase::Waiting;
                return Some(format!("{} was not ready within {within:?}; killed", self.text));
            }
            Phase::Waiting if self.process.is_none() && now >= self.since && !self.last_life => self.spawn(),
            Phase::Stopping => return self.press(now),
            _ => {}
        }
        None
    }

    /// What its process says of itself in the node's table.
    fn state_of(&self, node: &Node) -> Option<ModuleState> {
        let pid = self.process.as_ref()?.id();
        node.participants().iter().find(|p| p.module == self.name && p.pid == pid)?.state
    }

    /// It has ended: again, or not, as was asked for, or as its policy has it.
    fn ended(&mut self, status: ExitStatus, now: Instant) -> Option<String> {
        let how = match (status.code(), status.signal()) {
            (Some(code), _) => format!("ended with {code}"),
            (None, Some(signal)) => format!("was killed by signal {signal}"),
            (None, None) => "ended".to_owned(),
        };
        if let Some(ending) = self.ending.take() {
            self.printed.pass_on(None);
            return self.ended_as_told(&ending, &how, now);
        }
        // Whoever waits for its work expects it to go on as configured.
        self.turn_on = self.configured_on;
        let printed = self.printed.below();
        self.last_end = format!("{how}{printed}");
        // Started again, it would find the same configuration.
        let misconfigured = status.code() == Some(i32::from(StartError::CONFIGURATION));
        let next = if misconfigured || self.last_life { Next::Stay } else { self.policy.ended(status.success(), now) };
        let told = match next {
            Next::Stay => {
                self.phase = if status.success() { Phase::Ended } else { Phase::Failed };
                how
            }
            Next::GivenUp => {
                let Restart { at_most, within, .. } = self.policy.restart();
                self.phase = Phase::Failed;
                let told = format!("{how}; given up after {at_most} restarts within {within:?}");
                self.last_end = format!("{told}{printed}");
                told
            }
            Next::Again(pause) => {
                self.restarts += 1;
                self.phase = Phase::Waiting;
                self.since = now + pause;
                format!("{how}; starts again in {pause:?}")
            }
        };
        self.printed.pass_on((!status.success()).then_some(&told));
        Some(format!("{} {told}{printed}", self.text))
    }

    fn ended_as_told(&mut self, ending: &Ending, how: &str, now: Instant) -> Option<String> {
        let obeyed = if ending.killed.is_some() { "since it did not stop when told to" } else { "when told to" };
        self.last_end = format!("{how} {obeyed}");
        match ending.then {
            Then::End => {
                self.phase = Phase::Ended;
                None
            }
            Then::Stay => {
                self.phase = Phase::Stopped;
                Some(format!("{} is stopped, as asked", self.text))
            }
            Then::Start => {
                self.phase = Phase::Waiting;
                self.since = now;
                Some(format!("{} is started again, as asked", self.text))
            }
        }
    }

    /// Tells its process to end; `step` sees to it that it does. A later wish replaces an earlier one.
    pub(super) fn tell_to_end(&mut self, then: Then, node: &Node, now: Instant) {
        self.last_life |= then == Then::End;
        if then == Then::Start {
            self.policy.begin_anew();
        }
        if let Some(ending) = &mut self.ending {
            ending.then = then;
            return;
        }
        match self.phase {
            // Somebody has switched it off, and wants it so.
            Phase::Running => self.turn_on = self.state_of(node) != Some(ModuleState::Off),
            _ if self.phase.is_over() => self.turn_on = self.configured_on,
            _ => {}
        }
        if self.process.is_some() || self.over.is_some() {
            self.kill(Signal::SIGTERM);
            self.phase = Phase::Stopping;
            self.ending = Some(Ending { then, since: now, killed: None, left_behind: false });
        } else if then == Then::Start {
            (self.phase, self.since) = (Phase::Waiting, now);
        } else if !self.phase.is_over() {
            self.phase = if then == Then::Stay { Phase::Stopped } else { Phase::Ended };
        }
    }

    /// Sees to it that a process that was told to end does.
    fn press(&mut self, now: Instant) -> Option<String> {
        let (within, pid) = (self.stop_within, self.process.as_ref()?.id());
        let ending = self.ending.as_mut()?;
        match ending.killed {
            None if now >= ending.since + within => {
                self.force(now);
                Some(format!("{} did not stop within {within:?}; killed", self.text))
            }
            Some(at) if now >= at + KILL_TIME && !ending.left_behind => {
                // It waits for broken hardware, say. The others still have to be looked after.
                ending.left_behind = true;
                Some(format!("{} (process {pid}) cannot even be killed; left behind", self.text))
            }
            _ => None,
        }
    }

    /// Kills a process that was told to end; false when there is none, or it was killed before.
    pub(super) fn force(&mut self, now: Instant) -> bool {
        let Some(ending) = self.ending.as_mut().filter(|ending| ending.killed.is_none()) else { return false };
        ending.killed = Some(now);
        // A stopped process obeys this one too.
        self.kill(Signal::SIGKILL);
        true
    }

    /// Whether it was told to end and did not within its time.
    pub(super) fn overran(&self) -> bool {
        self.ending.as_ref().is_some_and(|ending| ending.killed.is_some())
    }

    /// Whether there is nothing more to wait for.
    pub(super) fn is_gone(&self) -> bool {
        let left_behind = self.ending.as_ref().is_some_and(|ending| ending.left_behind);
        left_behind || self.process.is_none() && self.over.is_none()
    }

    fn kill(&self, signal: Signal) {
        if let Some(process) = &self.process {
            // Not reaped yet, so the number still is this child's.
            let _ = kill(Pid::from_raw(process.id() as i32), signal);
        }
    }

    /// Launch ends: whatever happens, it is not started any more.
    pub(super) fn begin_last_life(&mut self) {
        self.last_life = true;
    }
}

fn is_ready(state: ModuleState) -> bool {
    !matches!(state, ModuleState::Starting | ModuleState::Stopping)
}

/// As much of a text as tools are told.
fn cut(text: &str) -> String {
    let end = (0..=TOLD_MAX.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    text[..end].to_owned()
}
