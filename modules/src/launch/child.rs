//! One module's process: started, watched, started again, stopped. Nothing here waits: each step looks, and says when to
//! look again.

use super::control::{ChildState, Phase};
use super::leftovers::KILL_TIME;
use super::policy::{Next, Policy};
use super::printed::Printed;
use super::program::Program;
use crate::output::Relay;
use crate::runtime::StartError;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_config::{Installation, Module, Restart, Start};
use rohrpost_mailbox::{ModuleState, Name, Node};
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child as Process, ExitStatus};
use std::time::{Duration, Instant};

/// While a module starts it is looked after so often, and when it has ended, until all that it printed is there.
const LOOK: Duration = Duration::from_millis(5);
/// When a process has ended, what it printed last is still on its way for moments; or for ever, if it left processes behind
/// that hold its pipe.
const PRINTED_WAIT: Duration = Duration::from_millis(100);
/// What somebody else may keep waiting for long is looked at so often: a registry that is locked, a process that was killed.
const LOOK_KEPT: Duration = Duration::from_millis(100);
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

impl Ending {
    /// When there is something to do about it, if it has not ended by then.
    fn press_at(&self, stop_within: Duration) -> Option<Instant> {
        match self.killed {
            _ if self.left_behind => None,
            Some(at) => Some(at + KILL_TIME),
            None => Some(self.since + stop_within),
        }
    }
}

/// Where a module's mailboxes are. They outlive its process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mailboxes {
    None,
    /// In use, or kept for its next process.
    Used,
    /// To be removed: senders are to be told that nobody reads there.
    Left,
}

/// A module and its process.
pub(super) struct Child {
    name: Name,
    text: String,
    program: Program,
    policy: Policy,
    /// Whether it is switched on when it is ready: as configured, or as somebody has switched it since.
    turn_on: bool,
    /// This process was on, or was in error on its way there: if it is off now, somebody wants it so.
    was_on: bool,
    configured_on: bool,
    ready_within: Duration,
    stop_within: Duration,
    phase: Phase,
    process: Option<Process>,
    mailboxes: Mailboxes,
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
    pub(super) fn new(module: &Module, installation: &Installation, program: Program, relay: &Relay) -> Self {
        let configured_on = module.start == Start::On;
        Self {
            name: module.name,
            text: installation.classes.format(module.name),
            program,
            policy: Policy::new(module.restart),
            turn_on: configured_on,
            was_on: false,
            configured_on,
            ready_within: module.ready_within,
            stop_within: module.stop_within,
            phase: Phase::Waiting,
            process: None,
            mailboxes: Mailboxes::None,
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

    /// It has been switched on, or is not meant to be; or it could not be switched on.
    pub(super) fn runs(&mut self, as_meant: bool) {
        self.phase = Phase::Running;
        self.was_on |= as_meant && self.turn_on;
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
            _ if self.has_left_mailboxes() => Some(LOOK_KEPT),
            Phase::Starting => Some(LOOK),
            // Its end comes with a signal.
            Phase::Stopping => {
                self.ending.as_ref()?.press_at(self.stop_within)?.checked_duration_since(now).or(Some(LOOK))
            }
            // Killed, since it did not get ready.
            Phase::Waiting if self.process.is_some() => Some(LOOK_KEPT),
            Phase::Waiting if !self.last_life => Some(self.since.saturating_duration_since(now)),
            _ => None,
        }
    }

    /// Starts the process; what there is to say if that fails. That is an end without success: the program may be replaced just
    /// now, or the computer be short of something for moments.
    pub(super) fn spawn(&mut self, now: Instant) -> Option<String> {
        match self.try_spawn() {
            Ok(process) => {
                self.process = Some(process);
                self.phase = Phase::Starting;
                self.since = now;
                self.was_on = false;
                self.mailboxes = Mailboxes::Used;
                self.lives += 1;
                None
            }
            Err(error) => {
                let how = format!("could not be started: {}: {error}", self.program.path().display());
                let next = self.policy.ended(false, now);
                Some(self.follow(next, false, &how, "", now))
            }
        }
    }

    fn try_spawn(&mut self) -> io::Result<Process> {
        // First: a process whose words nobody reads would be stuck at the first of them too many.
        let pipes = self.printed.begin()?;
        // Of a module that has ended by itself others expect that it works, and what waits in its mailboxes comes before any
        // word of launch's: so it switches itself on. At the first start launch does, when all are ready.
        self.program.spawn(self.lives > 0 && self.turn_on, self.restarts, pipes)
    }

    /// Looks after it; what there is to say.
    pub(super) fn step(&mut self, node: &Node, now: Instant) -> Option<String> {
        self.printed.attend(now);
        self.note_switch(node);
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
            Phase::Waiting if self.may_spawn(now) => return self.spawn(now),
            Phase::Stopping => return self.press(now),
            _ => {}
        }
        None
    }

    /// What its process says of itself in the node's table.
    fn state_of(&self, node: &Node) -> Option<ModuleState> {
        node.state_of(self.name, self.process.as_ref()?.id())
    }

    fn may_spawn(&self, now: Instant) -> bool {
        self.process.is_none() && now >= self.since && !self.last_life && !self.has_left_mailboxes()
    }

    /// Notes whether somebody has switched it on or off.
    fn note_switch(&mut self, node: &Node) {
        if self.phase != Phase::Running {
            return;
        }
        match self.state_of(node) {
            Some(ModuleState::On) => (self.was_on, self.turn_on) = (true, true),
            // Also of one that was off, and panicked.
            Some(ModuleState::Error) => self.was_on = true,
            Some(ModuleState::Off) if self.was_on => self.turn_on = false,
            _ => {}
        }
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
        // Whoever waits for its work expects it to go on as configured; but what a person has switched off stays off.
        self.turn_on &= self.configured_on;
        let printed = self.printed.below();
        // Started again, it would find the same configuration.
        let misconfigured = status.code() == Some(i32::from(StartError::CONFIGURATION));
        let success = status.success();
        let next = if misconfigured || self.last_life { Next::Stay } else { self.policy.ended(success, now) };
        Some(self.follow(next, success, &how, &printed, now))
    }

    /// What follows an end of its own accord; what there is to say about it.
    fn follow(&mut self, next: Next, success: bool, how: &str, printed: &str, now: Instant) -> String {
        self.last_end = format!("{how}{printed}");
        let told = match next {
            Next::Stay => {
                self.rest(if success { Phase::Ended } else { Phase::Failed });
                how.to_owned()
            }
            Next::GivenUp => {
                let Restart { at_most, within, .. } = self.policy.restart();
                self.rest(Phase::Failed);
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
        self.printed.pass_on((!success).then_some(&told));
        format!("{} {told}{printed}", self.text)
    }

    /// It is not started again unless somebody asks for it, and then finds empty mailboxes: what was meant for this run must
    /// not drive that one.
    fn rest(&mut self, phase: Phase) {
        self.phase = phase;
        if self.mailboxes == Mailboxes::Used {
            self.mailboxes = Mailboxes::Left;
        }
    }

    /// Whether its mailboxes are to be removed. Until they are, it is not started.
    pub(super) fn has_left_mailboxes(&self) -> bool {
        self.mailboxes == Mailboxes::Left
    }

    /// They are.
    pub(super) fn mailboxes_are_gone(&mut self) {
        self.mailboxes = Mailboxes::None;
    }

    fn ended_as_told(&mut self, ending: &Ending, how: &str, now: Instant) -> Option<String> {
        let obeyed = if ending.killed.is_some() { "since it did not stop when told to" } else { "when told to" };
        self.last_end = format!("{how} {obeyed}");
        match ending.then {
            Then::End => {
                self.rest(Phase::Ended);
                None
            }
            Then::Stay => {
                self.rest(Phase::Stopped);
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
        self.note_switch(node);
        if self.phase.is_over() {
            self.turn_on = self.configured_on;
        }
        if self.process.is_some() || self.over.is_some() {
            self.kill(Signal::SIGTERM);
            self.phase = Phase::Stopping;
            self.ending = Some(Ending { then, since: now, killed: None, left_behind: false });
        } else if then == Then::Start {
            (self.phase, self.since) = (Phase::Waiting, now);
        } else if !self.phase.is_over() {
            self.rest(if then == Then::Stay { Phase::Stopped } else { Phase::Ended });
        }
    }

    /// Sees to it that a process that was told to end does.
    fn press(&mut self, now: Instant) -> Option<String> {
        let (within, pid) = (self.stop_within, self.process.as_ref()?.id());
        let ending = self.ending.as_mut()?;
        match ending.killed {
            None if now >= ending.press_at(within)? => {
                self.force(now);
                Some(format!("{} did not stop within {within:?}; killed", self.text))
            }
            Some(_) if now >= ending.press_at(within)? => {
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
