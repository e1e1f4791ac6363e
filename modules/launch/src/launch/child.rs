//! One module's process: started, watched, started again, stopped. Nothing here waits: each step looks, and says when
//! to look again.

mod ended;
mod ending;
mod heard;
mod process;
mod starting;
mod watchdog;

pub(super) use ending::Then;

use super::health::Health;
use super::policy::Policy;
use super::printed::Printed;
use super::program::Program;
use super::repeats::Repeats;
use super::silence::SilenceWatch;
use crate::launcher::{ChildState, Phase};
use ending::ChildShutdown;
use process::ModuleProcess;
use rohrpost_config::{Installation, Module, Standby, Start, Watchdog};
use rohrpost_mailbox::{ModuleState, Name, Node, monotonic_ns};
use rohrpost_modules::launch_support::Relay;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// While a module starts it is looked after so often, and when it has ended, until all that it printed is there.
const LOOK: Duration = Duration::from_millis(5);
/// When a process has ended, what it printed last is still on its way for moments; or for ever, if it left processes
/// behind that hold its pipe.
const PRINTED_WAIT: Duration = Duration::from_millis(100);
/// What somebody else may keep waiting for long is looked at so often: a registry that is locked, a process that was
/// killed.
const LOOK_KEPT: Duration = Duration::from_millis(100);
/// Bytes of a text that are told to tools.
const TOLD_MAX: usize = 1000;

/// How a process ended, or why there is none.
#[derive(Clone, Copy)]
struct ProcessEnd<'a> {
    is_success: bool,
    how: &'a str,
    /// The number of the kernel's error.
    errno: Option<u16>,
    /// What it printed, each line on one of its own.
    printed: &'a str,
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
    /// The module's name and its aliases.
    names: Vec<Name>,
    program: Program,
    policy: Policy,
    /// How much is said of its ends.
    repeats: Repeats,
    /// Whether it is switched on when it is ready: as configured, or as somebody has switched it since.
    turn_on: bool,
    /// This process was on, or was in error on its way there: if it is off now, somebody wants it so.
    was_on: bool,
    configured_on: bool,
    /// Without it the node does not start.
    required: bool,
    ready_within: Duration,
    stop_within: Duration,
    phase: Phase,
    process: Option<ModuleProcess>,
    /// The present process has joined the node as the module, or the last one had.
    has_joined: bool,
    mailboxes: Mailboxes,
    /// The process has ended so, then; what it printed last may still come.
    over: Option<(ExitStatus, Instant)>,
    ending: Option<ChildShutdown>,
    /// When the process was started, or will be.
    since: Instant,
    /// Processes it has had.
    lives: u32,
    /// How often its policy started it again.
    restarts: u32,
    /// How it ended, and what it had printed; empty if it never did.
    last_end: String,
    health: Health,
    watchdog: Option<Watchdog>,
    /// Of the present process, once it is ready.
    watch: Option<SilenceWatch>,
    printed: Printed,
    /// Launch ends: nothing is started any more.
    last_incarnation: bool,
    /// Another node may run the module.
    stands_by: bool,
    standby: Standby,
    /// Without its lease it is killed after this time.
    off_within: Duration,
    /// From then on another node may run it, and a timer of the kernel has ended its process, ns of the monotonic
    /// clock.
    off_ns: Option<u64>,
}

impl Child {
    /// `is_missing`: its program is not there, and it is left out until somebody starts it.
    pub(super) fn new(
        module: &Module,
        installation: &Installation,
        program: Program,
        relay: &Relay,
        is_missing: bool,
    ) -> Self {
        let configured_on = module.start == Start::On;
        Self {
            name: module.name,
            text: installation.classes.format(module.name),
            names: module.names().collect(),
            program,
            policy: Policy::new(module.restart),
            repeats: Repeats::default(),
            turn_on: configured_on,
            was_on: false,
            configured_on,
            required: module.required,
            ready_within: module.ready_within,
            stop_within: module.stop_within,
            phase: match (is_missing, module.has_standby()) {
                (true, _) => Phase::LeftOut,
                (false, true) => Phase::StandsBy,
                (false, false) => Phase::Waiting,
            },
            stands_by: module.has_standby(),
            standby: module.standby,
            // A bit less than the lease grants it.
            off_within: installation.lease_times().off * 4 / 5,
            off_ns: None,
            process: None,
            has_joined: false,
            mailboxes: Mailboxes::None,
            over: None,
            ending: None,
            since: Instant::now(),
            lives: 0,
            restarts: 0,
            last_end: String::new(),
            health: Health::new(module.busy_after, Instant::now()),
            watchdog: module.watchdog,
            watch: None,
            printed: Printed::new(relay.voice(installation, module.name)),
            last_incarnation: false,
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

    pub(super) fn program(&mut self) -> &mut Program {
        &mut self.program
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

    /// The module's process, while there is one.
    pub(super) fn pid(&self) -> Option<u32> {
        self.process.as_ref().map(ModuleProcess::pid)
    }

    /// The process that launch has started for it, and has to ask for its end.
    pub(super) fn started(&self) -> Option<u32> {
        self.process.as_ref().map(ModuleProcess::started)
    }

    /// Whether its node does not start without it.
    pub(super) fn is_required(&self) -> bool {
        self.required
    }

    pub(super) fn wants_on(&self) -> bool {
        self.turn_on
    }

    /// The module has been switched on, or is not meant to be; or it could not be switched on.
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
            pid: self.pid(),
            lives: self.lives,
            restarts: self.restarts,
            attempt: self.policy.counted(),
            attempts_max: self.policy.restart().at_most,
            starts_in_ms: waits.then(|| self.since.saturating_duration_since(now).as_millis() as u32),
            last_end: cut(&self.last_end),
            error: cut(self.health.error()),
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
            Phase::Stopping => self.ending.as_ref()?.press_at()?.checked_duration_since(now).or(Some(LOOK)),
            // Killed, since it did not get ready.
            Phase::Waiting if self.process.is_some() => Some(LOOK_KEPT),
            Phase::Ready | Phase::Running => {
                let busy = self.health.look_at().saturating_duration_since(now);
                Some(self.watchdog_looks_in().map_or(busy, |hang| hang.min(busy)))
            }
            Phase::Waiting | Phase::StandsBy if self.may_be_due() => Some(self.since.saturating_duration_since(now)),
            _ => None,
        }
    }

    /// Looks after it; what there is to say.
    pub(super) fn step(&mut self, node: &Node, now: Instant) -> Option<String> {
        self.printed.attend(now);
        self.note_switch(node);
        if let Some(process) = &mut self.process {
            process.find_module(node);
            self.has_joined |= process.last_word(node).is_some();
            match process.end(node) {
                Ok(Some(status)) => {
                    self.process = None;
                    self.over = Some((status, now));
                    // Receivers look for what it left, and threads that sleep on it wake.
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
            Phase::Starting if self.state_of(node).is_some_and(is_ready) => {
                self.phase = Phase::Ready;
                self.watch = self.watchdog.map(|watchdog| SilenceWatch::new(watchdog.limit, monotonic_ns()));
            }
            Phase::Starting if now - self.since > self.ready_within => {
                let within = self.ready_within;
                self.process.iter().for_each(|process| process.kill(node));
                // For its end, and then as its policy has it.
                self.phase = Phase::Waiting;
                return Some(format!("{} was not ready within {within:?}; killed", self.text));
            }
            Phase::Waiting if self.may_spawn(now) => return self.spawn(node, now),
            Phase::StandsBy if self.wants_standby() && self.may_spawn(now) => return self.spawn(node, now),
            Phase::Stopping => return self.press(node, now),
            Phase::Ready | Phase::Running => {
                let note = self.end_if_it_hangs(node, now);
                return if self.ending.is_some() { note } else { self.note_busy(node, now) };
            }
            _ => {}
        }
        None
    }

    /// What went wrong with it, and what it is stuck in.
    pub(super) fn health(&mut self) -> &mut Health {
        &mut self.health
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

    /// The module is not started again unless somebody asks for it, and then finds empty mailboxes: what was meant
    /// for this run must not drive that one.
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

    /// Told when the mailboxes are gone.
    pub(super) fn mailboxes_are_gone(&mut self) {
        self.mailboxes = Mailboxes::None;
    }

    /// Launch ends: whatever happens, it is not started any more.
    pub(super) fn begin_last_incarnation(&mut self) {
        self.last_incarnation = true;
    }
}

/// One that stands by has no mailboxes that could be found.
fn is_ready(state: ModuleState) -> bool {
    !matches!(state, ModuleState::Starting | ModuleState::Stopping | ModuleState::StandsBy)
}

/// As much of a text as tools are told.
fn cut(text: &str) -> String {
    let end = (0..=TOLD_MAX.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    text[..end].to_owned()
}
