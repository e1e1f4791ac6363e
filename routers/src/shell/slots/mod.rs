//! The thread that sends in time slots: it has the router's mailbox, its queue, all sockets that send, and the clock.
//! What it does with them, and when, says the [driver](crate::driver).
//!
//! Its bell is never rung: publishing a package makes no system call, since the package waits for a slot anyway. The
//! thread takes nothing from the heap.

mod intake;
mod messages;
mod parts;
mod scheduling;
mod sleep;
mod state;

pub(super) use parts::SlotParts;
pub use scheduling::ActualScheduling;
pub use state::{SlotSnapshot, SlotStatus};

use super::clock::{ClockRuntime, ClockState};
use super::sending::Sending;
use super::socket::InSocket;
use super::threads::Shared;
use super::tx_thread::TransitInlet;
use crate::driver::{Answer, NotSent, Outlet, Platform, SlotDriver, SlotStep, WindowLog};
use crate::frame::NodeIndex;
use crate::intake::Transit;
use crate::outbound::Outbound;
use crate::report::Report;
use crate::security::PeerSessions;
use crate::settings::Settings;
use crate::stats::Stats;
use crate::tdma::{SlotCounts, SlotScheduler};
use crate::time::{Clock, SentId, Stamp, TIME_BYTES};
use intake::TransitAdapter;
use rohrpost_mailbox::{Name, Receiver, monotonic_ns};
use std::net::IpAddr;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};

/// The router of the thread.
pub(super) struct Own {
    pub(super) router: Name,
    pub(super) settings: Arc<Settings>,
    /// Where datagrams are sealed.
    pub(super) peer_sessions: Option<Arc<PeerSessions>>,
    /// What the thread that receives wants to have sent, and the socket by which it leaves.
    pub(super) answers: (mpsc::Receiver<Answer>, Arc<InSocket>),
    /// Where parts of replicas come from, if the node writes any: that is said once this thread runs.
    pub(super) parts: mpsc::Receiver<SlotParts>,
}

/// State of the thread.
pub(super) struct SlotThread {
    driver: SlotDriver,
    system: System,
}

/// Implements the driver's platform with the real system.
struct System {
    shared: Arc<Shared>,
    /// In which the thread that receives counts.
    stats: Arc<Stats>,
    clock: ClockRuntime,
    transit: Receiver,
    sending: Sending,
    answers: (mpsc::Receiver<Answer>, Arc<InSocket>),
    parts: Option<SlotParts>,
    parts_come: mpsc::Receiver<SlotParts>,
    settings: Arc<Settings>,
    router: Name,
    snapshot: SlotSnapshot,
    state: Arc<SlotStatus>,
}

impl SlotThread {
    /// Makes the thread from the parts of a router without slots.
    pub(super) fn new(
        own: Own,
        (shared, stats): (Arc<Shared>, Arc<Stats>),
        inlet: TransitInlet,
        clock: ClockRuntime,
        scheduler: SlotScheduler,
    ) -> Self {
        let TransitInlet { transit, sending } = inlet;
        let snapshot = SlotSnapshot {
            counts: SlotCounts::default(),
            silent: scheduler.silent(),
            lead_ns: (0, 0),
            granted: ActualScheduling::Ordinary,
            log: WindowLog::default(),
        };
        let state = Arc::new(SlotStatus::new(snapshot));
        let Own { router, settings, peer_sessions, answers, parts: parts_come } = own;
        let driver = SlotDriver::new(&settings, peer_sessions.as_ref(), scheduler, monotonic_ns());
        let system = System {
            shared,
            stats,
            clock,
            transit,
            sending,
            answers,
            parts: None,
            parts_come,
            settings,
            router,
            snapshot,
            state,
        };
        Self { driver, system }
    }

    /// What others may look at.
    pub(super) fn state(&self) -> Arc<SlotStatus> {
        self.system.state.clone()
    }

    /// And of the clock.
    pub(super) fn clock_state(&self) -> Arc<ClockState> {
        self.system.clock.state().clone()
    }

    /// Runs until the router ends.
    pub(super) fn run(self) {
        let Self { mut driver, mut system } = self;
        sleep::be_punctual();
        system.snapshot.granted = ActualScheduling::ask(driver.scheduler().table());
        while !system.shared.ends() {
            match driver.poll(&mut system) {
                SlotStep::Sleep { for_ns } => sleep::sleep(for_ns),
                SlotStep::Spin { .. } => std::hint::spin_loop(),
            }
        }
    }
}

impl Platform for System {
    fn local_ns(&self) -> u64 {
        self.clock.system.local.now_ns()
    }

    fn monotonic_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn clock(&self) -> &Clock {
        self.clock.driver.clock()
    }

    fn time(&mut self) -> (&mut Clock, &Stats) {
        (self.clock.driver.clock_mut(), &self.stats)
    }

    fn transit(&mut self) -> impl Transit {
        let Self { transit, sending: Sending { outbound, answers: report, .. }, clock, .. } = self;
        TransitAdapter { transit, outbound, report, local_ns: || clock.system.local.now_ns() }
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        Outlet::queue(&mut self.sending)
    }

    fn send(&mut self, now_ns: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        self.sending.send(now_ns, to, buffer, bytes)
    }

    fn send_time(&mut self, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        self.clock.driver.send(&mut self.clock.system, to, datagram);
    }

    fn next_answer(&mut self) -> Option<Answer> {
        self.answers.0.try_recv().ok()
    }

    fn send_answer(&mut self, to: IpAddr, datagram: &[u8]) {
        self.answers.1.answer(to, datagram);
    }

    fn take_time(&mut self, most: usize, left: impl FnMut(SentId, Stamp)) {
        self.clock.driver.take(&mut self.clock.system, most, left);
    }

    fn take_stranger(&mut self) -> Option<IpAddr> {
        self.clock.driver.take_stranger()
    }

    fn tidy(&mut self, now_ns: u64) {
        self.sending.deliver(now_ns);
        if self.parts.is_none() {
            self.parts = self.parts_come.try_recv().ok();
        }
        self.parts.iter_mut().for_each(|parts| _ = parts.sending.deliver(now_ns));
    }

    fn next_part(&mut self, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        self.parts.as_mut()?.next(datagram)
    }

    fn send_part(&mut self, to: NodeIndex, buffer: &mut [u8], bytes: usize) {
        self.parts.iter_mut().for_each(|parts| parts.send(to, buffer, bytes));
    }

    fn publish(&mut self, scheduler: &SlotScheduler, log: &WindowLog) {
        let Self { clock: ClockRuntime { driver, system }, settings, snapshot, state, .. } = self;
        driver.publish(system);
        let (clock, before, silent) = (driver.clock(), snapshot.silent, scheduler.silent());
        messages::tell_change(before, silent, || messages::parted(settings, clock.parted_by(system.local.now_ns())));
        let (counts, lead_ns) = (scheduler.counts(clock), scheduler.lead_ns());
        *snapshot = SlotSnapshot { counts, silent, lead_ns, log: *log, ..*snapshot };
        state.show(snapshot);
    }

    /// Shows how much of the tunnel's packets waits.
    fn queue_changed(&mut self) {
        let bytes = self.sending.outbound.waiting_bytes_of(self.router);
        self.shared.tunnel_bytes.store(bytes, Ordering::Relaxed);
    }
}
