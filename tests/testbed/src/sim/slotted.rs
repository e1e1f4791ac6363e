//! The layer of a router with time slots: the driver of the shell, which has packages and time in the hands of one
//! thread, on a simulated platform, and watched.

use super::clock::Now;
use super::packages::{Packages, TransitAdapter};
use super::promise::Promise;
use super::replicas::{self, Replicas};
use super::spans::RECOVERY_NS;
use super::station::{Arrived, Io, Layer, Port, Sent};
use super::ticking::{self, Ticking};
use super::transmission::{Basis, SendBasis};
use rohrpost_routers::driver::{Answer, NotSent, Platform, SlotDriver, SlotEvent, SlotStep, WindowLog, spin_ns};
use rohrpost_routers::frame::{FrameHead, FrameKind, NodeIndex};
use rohrpost_routers::intake::{MAKING_NS, Transit};
use rohrpost_routers::outbound::Outbound;
use rohrpost_routers::report::Report;
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use rohrpost_routers::tdma::{
    Carries, Planned, SlotScheduler, SlotTable, TransmitWindow, UNPROVEN_CYCLES, WindowVerdict,
};
use rohrpost_routers::time::{Clock, SentId, Stamp, Step, TIME_BYTES};
use std::net::IpAddr;
use std::sync::Arc;

/// One incarnation of a router's timing thread.
pub(crate) struct Slotted {
    packages: Packages,
    time: Ticking,
    driver: SlotDriver,
    replicas: Option<Replicas>,
    watch: WindowWatch,
    /// It does nothing before, ns of its monotonic clock: it sleeps or is busy.
    wake_ns: u64,
    /// When something is due for it, at the latest.
    due_ns: u64,
}

/// What is watched over windows.
struct WindowWatch {
    /// A sender may be off by half of the guard.
    allowance_ns: u64,
    cycle_ns: u64,
    /// The time basis on which this node sends in the window, and the number of datagrams sent before it.
    window: (SendBasis, usize),
    /// When the window began in which it last said a hello by what it had overheard, local ns.
    asked_ns: Option<u64>,
    /// When it began, true ns; none as soon as it has joined.
    joins_since_ns: Option<u64>,
    /// Whether the thread stood still when it ran last.
    stood_still: bool,
}

/// What the driver has of the simulated computer.
struct Ground<'a, 'b> {
    packages: &'a mut Packages,
    time: &'a mut Ticking,
    replicas: &'a mut Option<Replicas>,
    watch: &'a mut WindowWatch,
    io: &'a mut Io<'b>,
}

impl Platform for Ground<'_, '_> {
    fn local_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn monotonic_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn clock(&self) -> &Clock {
        self.time.core()
    }

    fn time(&mut self) -> (&mut Clock, &Stats) {
        (self.time.clock(), self.packages.stats())
    }

    fn transit(&mut self) -> impl Transit {
        TransitAdapter { packages: self.packages, io: self.io }
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        self.packages.queue(self.io)
    }

    fn send(&mut self, _: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        self.packages.send_in(self.io, to, &buffer[..bytes])
    }

    fn send_time(&mut self, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        self.time.send_in(self.io, to, datagram);
    }

    fn next_answer(&mut self) -> Option<Answer> {
        self.packages.next_answer()
    }

    fn send_answer(&mut self, to: IpAddr, datagram: &[u8]) {
        self.packages.send_answer(self.io, to, datagram);
    }

    fn take_time(&mut self, most: usize, left: impl FnMut(SentId, Stamp)) {
        self.time.take(self.io, most, left);
    }

    fn take_stranger(&mut self) -> Option<IpAddr> {
        self.time.take_stranger()
    }

    fn tidy(&mut self, _: u64) {}

    fn next_part(&mut self, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        let replicas = self.replicas.as_mut()?;
        self.io.works(MAKING_NS);
        replicas.next_part(self.io, datagram)
    }

    fn send_part(&mut self, to: NodeIndex, buffer: &mut [u8], bytes: usize) {
        self.replicas.iter_mut().for_each(|replicas| replicas.send_part(self.io, to, &buffer[..bytes]));
    }

    fn publish(&mut self, _: &SlotScheduler, _: &WindowLog) {
        self.time.publish(self.io);
    }

    fn happened(&mut self, event: SlotEvent<'_>) {
        match event {
            SlotEvent::Awake(planned) => self.oversleeps(planned),
            SlotEvent::Idle(Step::Send { .. }) => {
                self.io.oracle.broken(self.io.now, Promise::Exclusive, "a clock sends outside of its windows".into());
            }
            SlotEvent::Idle(Step::Wait { .. }) => {}
            SlotEvent::Decided(planned, verdict) => self.validated(planned, verdict),
            SlotEvent::AnsweredOverheard(tx_window) => self.answered_overheard(tx_window),
            SlotEvent::Made => self.made(),
            SlotEvent::Missed { datagram, held: true } => {
                self.io.oracle.saw("missed its slot, held");
                self.packages.holds(self.io, datagram);
            }
            SlotEvent::Missed { held: false, .. } => self.io.oracle.saw("missed its slot, lost"),
            SlotEvent::DroppedOld(datagram) => {
                self.io.oracle.saw("held for too long");
                self.packages.drops_held(self.io, datagram);
            }
            SlotEvent::LeftOut => self.io.oracle.saw("slot left out"),
            SlotEvent::Closed(_) => self.closed(),
        }
    }
}

impl Ground<'_, '_> {
    /// It may have woken up so late that it takes nothing before the call.
    fn oversleeps(&mut self, planned: &Planned) {
        let percent = self.io.plan.slots.as_ref().map_or(0, |slots| slots.oversleeps_percent);
        if percent > 0 && self.io.chance.percent(percent) {
            self.io.works(planned.call_ns.saturating_sub(self.io.now.monotonic_ns));
        }
    }

    /// To make a datagram takes its time; and the thread may stand still before it hands it over.
    fn made(&mut self) {
        self.packages.makes(self.io.now);
        self.io.works(MAKING_NS);
        let is_fixed = self.io.now.true_ns >= self.io.plan.fixed_ns;
        if let Some(slots) = &self.io.plan.slots {
            let still_ns = slots.still_ns(is_fixed, self.io.chance);
            self.io.works(still_ns);
        }
    }

    fn validated(&mut self, planned: &Planned, verdict: &WindowVerdict) {
        let io = &mut *self.io;
        io.line(|| format!("{:?}: {verdict:?}", planned.window));
        match verdict {
            WindowVerdict::Send(tx_window) => {
                let says = self.says(tx_window.carries);
                self.off_the_master(&says);
                self.io.oracle.wire.goes_by(self.io.now, self.io.node, says);
                self.watch.window = (says, self.io.sent.len());
            }
            WindowVerdict::Late => io.oracle.saw("window late"),
            WindowVerdict::Silent(_) => io.oracle.saw("window silent"),
            WindowVerdict::Early | WindowVerdict::Idle => {}
        }
    }

    fn closed(&mut self) {
        let (says, before) = self.watch.window;
        let io = &mut *self.io;
        if io.sent.len() > before {
            io.oracle.saw("window used");
        }
        for sent in &io.sent[before..] {
            if !may_send(says.basis, sent) {
                let text = format!("node {} is not sure of the time, and sends more than questions: {says:?}", io.node);
                io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
            }
        }
    }

    /// A node that has only unverified time sends at most one hello in [`UNPROVEN_CYCLES`] cycles.
    fn answered_overheard(&mut self, tx_window: &TransmitWindow) {
        let is_misled = self.time.overheard(self.io.now, self.watch.allowance_ns).is_some_and(|voice| voice.is_misled);
        let (io, watch) = (&mut *self.io, &mut *self.watch);
        io.oracle.saw(if is_misled { "asked by an echo" } else { "asked by what was overheard" });
        // The begin of a window comes from the current estimate, and each estimate may be off by the allowance.
        let least_ns = UNPROVEN_CYCLES * watch.cycle_ns - 2 * watch.allowance_ns;
        if let Some(before_ns) = watch.asked_ns.replace(tx_window.begin_ns)
            && tx_window.begin_ns - before_ns < least_ns
        {
            let text =
                format!("node {} says hellos at {before_ns} and {} by what it overheard", io.node, tx_window.begin_ns);
            io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
        }
    }

    /// The time basis for sending now: the node's own time if its stated bound is at most half of the guard, else what
    /// it heard.
    fn says(&self, carries: Carries) -> SendBasis {
        let (io, now_ns, allowed_ns) = (&*self.io, self.io.now.monotonic_ns, self.watch.allowance_ns);
        let clock = self.time.core();
        let own = clock.estimate().filter(|own| own.bound_ns(now_ns) <= allowed_ns);
        let digest = clock.digest();
        match own {
            Some(own) if clock.is_beginning() => SendBasis {
                basis: Basis::Begins { since_ns: io.now.true_ns },
                digest,
                term: clock.term(),
                estimate: Some(own),
            },
            Some(own) => SendBasis { basis: Basis::Own, digest, term: clock.reading(now_ns).term, estimate: Some(own) },
            None if carries == Carries::Hello => {
                let Some(voice) = self.time.overheard(io.now, allowed_ns) else { return SendBasis::default() };
                let basis = Basis::Overheard { is_misled: voice.is_misled };
                SendBasis { basis, digest, term: voice.term, estimate: Some(voice.estimate) }
            }
            None => {
                let estimate = clock.coarse(now_ns);
                let is_misled = self.time.is_misled(io.now, allowed_ns);
                SendBasis { basis: Basis::Heard { is_misled }, digest, term: self.time.told_term(), estimate }
            }
        }
    }

    /// A sender is off the time of its master by half of the guard at most, whatever it states itself.
    fn off_the_master(&mut self, says: &SendBasis) {
        let io = &mut *self.io;
        let Some(estimate) = says.estimate else { return };
        let Some(masters_ns) = io.oracle.times.of_term_ns(io.now, (says.digest, says.term)) else { return };
        let off_ns = estimate.system_ns(io.now.monotonic_ns).abs_diff(masters_ns);
        if off_ns > self.watch.allowance_ns && !says.basis.is_misled() {
            let text = format!("node {} is {off_ns} ns off the time of its master, and sends: {says:?}", io.node);
            io.oracle.broken(io.now, Promise::SilentWhenUnsure, text);
        }
    }
}

impl Slotted {
    /// An incarnation that begins now, of these two.
    pub(crate) fn new(
        (packages, time, replicas): (Packages, Ticking, Option<Replicas>),
        settings: &Settings,
        table: SlotTable,
        now: Now,
    ) -> Self {
        let (time, spin_ns) = (time.in_slots(&table), spin_ns(table.cycle_ns()));
        let watch = WindowWatch {
            allowance_ns: table.allowance_ns(),
            cycle_ns: table.cycle_ns(),
            window: (SendBasis::default(), 0),
            asked_ns: None,
            joins_since_ns: Some(now.true_ns),
            stood_still: false,
        };
        let (scheduler, settings) = (SlotScheduler::new(table, spin_ns), Arc::new(settings.clone()));
        let driver = SlotDriver::new(&settings, packages.peer_sessions(), scheduler, now.monotonic_ns);
        Self { packages, time, driver, replicas, watch, wake_ns: 0, due_ns: 0 }
    }

    /// The thread runs until it sleeps, or spins for what only time brings.
    fn run(&mut self, io: &mut Io<'_>) {
        let Self { packages, time, driver, replicas, watch, .. } = self;
        if std::mem::take(&mut watch.stood_still) {
            // What came of that is seen now.
            time.publish(io);
        }
        let step = driver.poll(&mut Ground { packages, time, replicas, watch, io });
        let now_ns = io.now.monotonic_ns;
        self.watch.stood_still = io.stood_still();
        (self.wake_ns, self.due_ns) = match step {
            SlotStep::Sleep { for_ns } => (now_ns + for_ns, now_ns + for_ns),
            // Packages that come meanwhile are taken.
            SlotStep::Spin { until_ns } => (now_ns, until_ns),
        };
    }

    /// A node that begins takes part in time.
    fn watch_joining(&mut self, io: &mut Io<'_>) {
        let Some(since_ns) = self.watch.joins_since_ns else { return };
        let took_ns = io.now.true_ns - since_ns;
        if self.driver.scheduler().silent().is_none() {
            self.watch.joins_since_ns = None;
            io.oracle.saw("joined");
            io.line(|| format!("has joined after {} ms", took_ns / 1_000_000));
        } else if io.plan.slots.as_ref().and_then(|slots| slots.joins_ns).is_some_and(|joins_ns| took_ns > joins_ns) {
            let text = format!("node {} has not joined after {} ms", io.node, took_ns / 1_000_000);
            io.oracle.broken(io.now, Promise::Recovery, text);
        }
    }
}

impl Layer for Slotted {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        match arrived.port {
            ticking::PORT => self.time.handle(io, arrived),
            replicas::PORT => self.replicas.iter_mut().for_each(|replicas| replicas.handle(io, arrived)),
            _ => self.packages.handle(io, arrived),
        }
    }

    fn left(&mut self, io: &mut Io<'_>, port: Port, index: u64, at: Now) {
        if port == ticking::PORT {
            self.time.left(io, port, index, at);
        }
    }

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        let mut idle_ns = self.packages.receive(io);
        if let Some(replicas) = &mut self.replicas {
            idle_ns = idle_ns.min(replicas.receive(io));
            replicas.find_streams(io);
        }
        if self.wake_ns <= io.now.monotonic_ns {
            self.run(io);
        }
        self.due_ns.min(idle_ns)
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
        // A node that is further off than it may be says nothing, and slews for up to five seconds, or waits until a
        // master begins an epoch, see [`EPOCH_PAUSE_NS`](super::spans::EPOCH_PAUSE_NS).
        let waits = is_of_later_epoch || off_ns.is_some_and(|off_ns| off_ns > self.watch.allowance_ns);
        if waits && io.now.true_ns < io.plan.stepped_ns {
            io.oracle.saw("waits for an epoch");
            io.oracle.well_ns = io.oracle.well_ns.max(io.now.true_ns + RECOVERY_NS);
        }
        if io.now.true_ns >= io.plan.stepped_ns
            && let Some(why) = self.driver.scheduler().silent()
        {
            io.oracle.broken(io.now, Promise::Recovery, format!("node {} is silent: {why}", io.node));
        }
        self.time.check(io, well);
        self.packages.check(io, well);
        self.replicas.iter_mut().for_each(|replicas| replicas.check(io, well));
    }

    fn close(&mut self, io: &mut Io<'_>) {
        self.time.close(io);
        self.packages.close(io);
        self.replicas.iter_mut().for_each(|replicas| replicas.close(io));
    }
}

/// A node with heard time may send a Request, a warm-up and a hello. A node with unverified time may send a hello only.
fn may_send(basis: Basis, sent: &Sent) -> bool {
    let Ok((head, _)) = FrameHead::read(&sent.bytes) else { return false };
    match basis {
        Basis::Heard { .. } => matches!(head.kind, FrameKind::Request | FrameKind::WarmUp | FrameKind::Hello),
        Basis::Overheard { .. } => head.kind == FrameKind::Hello,
        Basis::Own | Basis::Begins { .. } => true,
    }
}
