//! The layer of a router with time slots: packages and time in the hands of one thread, which sends in the node's own windows alone.

use super::clock::Now;
use super::packages::{Hands, Packages};
use super::promise::Promise;
use super::spans::RECOVERY_NS;
use super::station::{Arrived, Io, Layer, PORTS, Port, Sent};
use super::ticking::{self, Ticking};
use super::transmission::{Basis, Says};
use rohrpost_routers::frame::{FrameHead, Kind};
use rohrpost_routers::intake::{Intake, QUIET_NS, TAKING_NS};
use rohrpost_routers::tdma::{
    Carries, Kind as WindowKind, Next, Planned, SlotScheduler, Table, TransmitWindow, UNPROVEN_CYCLES, Verdict,
};
use std::collections::VecDeque;

/// The thread wakes so long before its call, to spin.
const SPIN_NS: u64 = 150_000;
/// First datagrams of windows whose stamps are waited for at a time.
const AWAITED_MAX: usize = 16;

/// One incarnation of a router's timing thread.
pub struct Slotted {
    packages: Packages,
    intake: Intake,
    time: Ticking,
    scheduler: SlotScheduler,
    planned: Option<Planned>,
    /// Whether it is awake for the planned window.
    is_open: bool,
    /// It woke up so late for the planned window that it takes nothing before the call.
    has_overslept: bool,
    /// Datagrams that left each socket.
    sent: [u64; PORTS],
    /// First datagrams of windows: socket, how many went before, and when they were handed over.
    firsts: VecDeque<(Port, u64, u64)>,
    /// When the window began in which it last said a hello by what it had overheard, local ns.
    asked_ns: Option<u64>,
    /// When it began, true ns; none as soon as it has joined.
    joins_since_ns: Option<u64>,
}

impl Slotted {
    /// An incarnation that begins now, of these two.
    pub fn new(packages: Packages, time: Ticking, table: Table, now: Now) -> Self {
        let intake = Intake::new(now.monotonic_ns);
        let (time, scheduler) = (time.in_slots(&table), SlotScheduler::new(table, SPIN_NS));
        Self {
            packages,
            intake,
            time,
            scheduler,
            planned: None,
            is_open: false,
            has_overslept: false,
            sent: [0; PORTS],
            firsts: VecDeque::new(),
            asked_ns: None,
            joins_since_ns: Some(now.true_ns),
        }
    }

    /// Awake for a slot, it takes from the mailbox what that has room for.
    fn open(&mut self, io: &mut Io<'_>) {
        let now_ns = io.now.monotonic_ns;
        let Some(planned) = self.planned.filter(|planned| planned.wake_ns <= now_ns && !self.is_open) else { return };
        self.is_open = true;
        let oversleeps = io.plan.slots.as_ref().map_or(0, |slots| slots.oversleeps_percent);
        self.has_overslept = oversleeps > 0 && io.chance.percent(oversleeps);
        if let (WindowKind::Slot { .. }, None) = (planned.window.kind, self.scheduler.silent()) {
            let sends_ns = planned.end_ns.saturating_sub(planned.begin_ns);
            self.intake.open(now_ns, self.scheduler.table().wire().bytes_in(sends_ns));
        }
    }

    /// Until shortly before the call: to take a package lasts its time.
    fn take_before(&mut self, io: &mut Io<'_>, call_ns: u64) {
        let mut left_ns = if self.has_overslept { 0 } else { call_ns.saturating_sub(io.now.monotonic_ns) };
        let mut hands = Hands { packages: &mut self.packages, io, tx_window: None };
        while left_ns > QUIET_NS && self.intake.take_one(&mut hands) {
            left_ns = left_ns.saturating_sub(TAKING_NS);
        }
    }

    /// It is time for a window.
    fn window(&mut self, io: &mut Io<'_>, planned: &Planned) {
        let verdict = self.scheduler.validate(planned, io.now.monotonic_ns, self.time.clock());
        io.line(|| format!("{:?}: {verdict:?}", planned.window));
        match verdict {
            Verdict::Send(tx_window) => self.send(io, tx_window),
            Verdict::Late => io.oracle.saw("window late"),
            Verdict::Silent(_) => io.oracle.saw("window silent"),
            Verdict::Early | Verdict::Idle => {}
        }
        self.intake.close();
    }

    /// Sends what there is, time first.
    fn send(&mut self, io: &mut Io<'_>, mut tx_window: TransmitWindow) {
        let (before, asked_ns) = (io.sent.len(), io.now.monotonic_ns);
        let says = self.says(io, tx_window.carries);
        self.watch(io, &says);
        io.oracle.wire.goes_by(io.now, io.node, says);
        self.time.poll_in(io, Some(&mut tx_window));
        self.greet(io, &mut tx_window);
        if tx_window.carries == Carries::All {
            self.packages.poll_in(io, &mut self.intake, &mut tx_window);
        }
        self.scheduler.close(&tx_window);
        if let Some(first) = io.sent.get(before) {
            io.oracle.saw("window used");
            let handed_ns = first.handed.monotonic_ns.max(asked_ns);
            self.firsts.push_back((first.port, self.sent[first.port], handed_ns));
            self.firsts.truncate(AWAITED_MAX);
        }
        for sent in &io.sent[before..] {
            self.sent[sent.port] += 1;
            if !may_send(says.basis, sent) {
                let text = format!("node {} is not sure of the time, and sends more than questions: {says:?}", io.node);
                io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
            }
        }
    }

    /// Says a hello that waits; by what it has only overheard, seldom.
    fn greet(&mut self, io: &mut Io<'_>, tx_window: &mut TransmitWindow) {
        let overheard =
            self.time.overheard(io.now, self.allowance_ns()).filter(|_| tx_window.carries == Carries::Hello);
        let says = self.packages.say_in(io, overheard.as_ref().map(|voice| voice.from), tx_window);
        if !says || overheard.is_none() {
            return;
        }
        self.time.asked_overheard(io.now);
        io.oracle.saw(if overheard.is_some_and(|voice| voice.is_misled) {
            "asked by an echo"
        } else {
            "asked by what was overheard"
        });
        let least_ns = UNPROVEN_CYCLES * self.scheduler.table().cycle_ns();
        if let Some(before_ns) = self.asked_ns.replace(tx_window.begin_ns)
            && tx_window.begin_ns - before_ns < least_ns
        {
            let text =
                format!("node {} says hellos at {before_ns} and {} by what it overheard", io.node, tx_window.begin_ns);
            io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
        }
    }

    /// Who sends may be off by half of the guard.
    fn allowance_ns(&self) -> u64 {
        self.scheduler.table().allowance_ns()
    }

    /// By what this node sends now: by its own time if that may be off by half of the guard at most, as it says; else by what it heard.
    fn says(&mut self, io: &Io<'_>, carries: Carries) -> Says {
        let (now_ns, allowed_ns) = (io.now.monotonic_ns, self.allowance_ns());
        let clock = self.time.clock();
        let own = clock.estimate().filter(|own| own.bound_ns(now_ns) <= allowed_ns);
        let digest = clock.digest();
        match own {
            Some(own) if clock.is_beginning() => Says {
                basis: Basis::Begins { since_ns: io.now.true_ns },
                digest,
                term: clock.term(),
                estimate: Some(own),
            },
            Some(own) => Says { basis: Basis::Own, digest, term: clock.reading(now_ns).term, estimate: Some(own) },
            None if carries == Carries::Hello => {
                let Some(voice) = self.time.overheard(io.now, allowed_ns) else { return Says::default() };
                let basis = Basis::Overheard { is_misled: voice.is_misled };
                Says { basis, digest, term: voice.term, estimate: Some(voice.estimate) }
            }
            None => {
                let estimate = clock.coarse(now_ns);
                let is_misled = self.time.is_misled(io.now, allowed_ns);
                Says { basis: Basis::Heard { is_misled }, digest, term: self.time.told_term(), estimate }
            }
        }
    }

    /// Whoever begins takes part in time.
    fn watch_joining(&mut self, io: &mut Io<'_>) {
        let Some(since_ns) = self.joins_since_ns else { return };
        let took_ns = io.now.true_ns - since_ns;
        if self.scheduler.silent().is_none() {
            self.joins_since_ns = None;
            io.oracle.saw("joined");
            io.line(|| format!("has joined after {} ms", took_ns / 1_000_000));
        } else if io.plan.slots.as_ref().and_then(|slots| slots.joins_ns).is_some_and(|joins_ns| took_ns > joins_ns) {
            let text = format!("node {} has not joined after {} ms", io.node, took_ns / 1_000_000);
            io.oracle.broken(io.now, Promise::Recovery, text);
        }
    }

    /// Whoever sends is off the time of its master by half of the guard at most, whatever it says itself.
    fn watch(&self, io: &mut Io<'_>, says: &Says) {
        let Some(estimate) = says.estimate else { return };
        let Some(masters_ns) = io.oracle.times.of_term_ns(io.now, (says.digest, says.term)) else { return };
        let off_ns = estimate.system_ns(io.now.monotonic_ns).abs_diff(masters_ns);
        if off_ns > self.allowance_ns() && !says.basis.is_misled() {
            let text = format!("node {} is {off_ns} ns off the time of its master, and sends: {says:?}", io.node);
            io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
        }
    }
}

impl Layer for Slotted {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        if arrived.port == ticking::PORT {
            self.time.handle(io, arrived);
        } else {
            self.packages.handle(io, arrived);
            self.time.clock().hears_by(self.packages.stats(), io.now.monotonic_ns, io.now.monotonic_ns);
        }
    }

    fn left(&mut self, io: &mut Io<'_>, port: Port, index: u64, at: Now) {
        let first = self.firsts.iter().position(|first| (first.0, first.1) == (port, index));
        if let Some((_, _, user_ns)) = first.and_then(|first| self.firsts.remove(first)) {
            let stamp = self.time.stamp(io, at);
            self.scheduler.left(user_ns, stamp);
        }
        if port == ticking::PORT {
            self.time.left(io, port, index, at);
        }
    }

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        let now_ns = io.now.monotonic_ns;
        let left_ns = self.planned.map_or(u64::MAX, |planned| planned.wake_ns.saturating_sub(now_ns));
        let idle_ns = self.packages.tidy(io).min(self.time.poll_in(io, None));
        self.intake.relieve(now_ns, &mut Hands { packages: &mut self.packages, io, tx_window: None }, || left_ns);
        let until_ns = loop {
            // Deduplicator awake for a window, the thread spins until its call.
            self.open(io);
            match self.planned.filter(|planned| planned.wake_ns <= now_ns) {
                Some(planned) if now_ns < planned.call_ns => {
                    self.take_before(io, planned.call_ns);
                    break planned.call_ns;
                }
                Some(planned) => {
                    (self.planned, self.is_open) = (None, false);
                    self.window(io, &planned);
                }
                None => match self.scheduler.next(now_ns, self.time.clock()) {
                    Next::Silent { until_ns, .. } => {
                        (self.planned, self.is_open) = (None, false);
                        break until_ns;
                    }
                    Next::Window(planned) => {
                        self.planned = Some(planned);
                        if now_ns < planned.wake_ns {
                            break planned.wake_ns;
                        }
                    }
                },
            }
        };
        until_ns.min(idle_ns)
    }

    fn dies(&mut self, io: &mut Io<'_>) {
        self.time.dies(io);
        self.packages.dies(io);
    }

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.watch_joining(io);
        let clock = self.time.clock();
        let off_ns = io.oracle.times.off_ns(io.now, io.node, (clock.digest(), clock.term()));
        let masters = clock.master().and_then(|master| io.oracle.times.page(io.now, master.into()));
        let is_of_later_epoch = masters.is_some_and(|page| page.epoch < clock.record().epoch);
        // Who is further off than it may be says nothing, and slews for up to five seconds, or waits until a master begins an epoch, see
        // [`EPOCH_PAUSE_NS`](super::spans::EPOCH_PAUSE_NS).
        let waits = is_of_later_epoch || off_ns.is_some_and(|off_ns| off_ns > self.allowance_ns());
        if waits && io.now.true_ns < io.plan.stepped_ns {
            io.oracle.saw("waits for an epoch");
            io.oracle.well_ns = io.oracle.well_ns.max(io.now.true_ns + RECOVERY_NS);
        }
        if io.now.true_ns >= io.plan.stepped_ns
            && let Some(why) = self.scheduler.silent()
        {
            io.oracle.broken(io.now, Promise::Recovery, format!("node {} is silent: {why}", io.node));
        }
        self.time.check(io, well);
        self.packages.check(io, well);
    }

    fn close(&mut self, io: &mut Io<'_>) {
        self.time.close(io);
        self.packages.close(io);
    }
}

/// Whoever goes by what it heard asks what time it is, or who lives; by what it overheard, who lives.
fn may_send(basis: Basis, sent: &Sent) -> bool {
    let Ok((head, _)) = FrameHead::read(&sent.bytes) else { return false };
    match basis {
        Basis::Heard { .. } => matches!(head.kind, Kind::Request | Kind::WarmUp | Kind::Hello),
        Basis::Overheard { .. } => head.kind == Kind::Hello,
        Basis::Own | Basis::Begins { .. } => true,
    }
}
