//! The thread that sends in time slots: it has the router's mailbox, its queue, all sockets that send, and the clock.
//! What it does with them, and when, says the [driver](crate::driver).
//!
//! Its bell is never rung: publishing a package makes no system call, since the package waits for a slot anyway. The
//! thread takes nothing from the heap.

mod alarm;
mod answer_queue;
mod granted;
mod intake;
mod speech;
mod state;

pub use granted::Granted;
pub use state::{SlotSnapshot, SlotStatus};

use super::answers::ErrorReplier;
use super::clock::{ClockState, Works};
use super::failure::Failure;
use super::sending::Sending;
use super::threads::Shared;
use super::tx_thread::TxThread;
use super::wire::PeerSockets;
use crate::driver::{NotSent, Platform, SlotDriver, SlotStep, WindowLog};
use crate::frame::NodeIndex;
use crate::intake::Transit;
use crate::outbound::Outbound;
use crate::report::Report;
use crate::stats::Stats;
use crate::tdma::{SlotScheduler, TransmitWindow};
use crate::time::{Clock, SentId, Stamp, TIME_BYTES};
pub(super) use answer_queue::{ANSWERS, Answer, AnswerQueue, REFUSAL_BYTES};
use intake::Hands;
use rohrpost_mailbox::{Name, Receiver, monotonic_ns};
use rohrpost_network::Network;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// What the thread knows of its node.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub(super) router: Name,
    /// Nodes of the network.
    pub(super) nodes: usize,
    pub(super) network: Network,
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
    works: Works,
    transit: Receiver,
    outbound: Outbound,
    answers: ErrorReplier,
    wire: PeerSockets,
    line: AnswerQueue,
    router: Name,
    snapshot: SlotSnapshot,
    state: Arc<SlotStatus>,
}

impl SlotThread {
    /// Makes the thread from the parts of a router without slots.
    pub(super) fn new(
        own: Own,
        tx_thread: TxThread,
        works: Works,
        scheduler: SlotScheduler,
        line: AnswerQueue,
    ) -> Self {
        let TxThread { shared, transit, sending, .. } = tx_thread;
        let Sending { outbound, answers, wire, datagram, stats } = sending;
        let snapshot = SlotSnapshot::new(scheduler.silent());
        let state = Arc::new(SlotStatus::new(snapshot));
        let driver = SlotDriver::new(own.network, own.nodes, scheduler, datagram, monotonic_ns());
        let router = own.router;
        let system = System { shared, stats, works, transit, outbound, answers, wire, line, router, snapshot, state };
        Self { driver, system }
    }

    /// What others may look at.
    pub(super) fn state(&self) -> Arc<SlotStatus> {
        self.system.state.clone()
    }

    /// And of the clock.
    pub(super) fn clock_state(&self) -> Arc<ClockState> {
        self.system.works.state().clone()
    }

    /// Runs until the router ends.
    pub(super) fn run(self) {
        let Self { mut driver, mut system } = self;
        alarm::be_punctual();
        system.snapshot.granted = Granted::ask(driver.scheduler().table());
        system.works.runs_in_real_time(system.snapshot.granted != Granted::Ordinary);
        while !system.shared.ends() {
            match driver.poll(&mut system) {
                SlotStep::Sleep { for_ns } => alarm::sleep(for_ns),
                SlotStep::Spin { .. } => std::hint::spin_loop(),
            }
        }
    }
}

impl Platform for System {
    fn local_ns(&self) -> u64 {
        self.works.now_ns()
    }

    fn monotonic_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn clock(&self) -> &Clock {
        &self.works.clock
    }

    fn time(&mut self) -> (&mut Clock, &Stats) {
        (&mut self.works.clock, &self.stats)
    }

    fn transit(&mut self) -> impl Transit {
        let Self { transit, outbound, answers: report, works, .. } = self;
        Hands { transit, outbound, report, local_ns: || works.now_ns() }
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        (&mut self.outbound, &mut self.answers)
    }

    fn send(&mut self, now_ns: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        let sent = self.wire.send_made(now_ns, to, buffer, bytes);
        if sent.is_err_and(Failure::is_loss) { Err(NotSent) } else { Ok(()) }
    }

    fn send_time(&mut self, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        self.works.send(to, datagram);
    }

    fn answer(&mut self, tx_window: &TransmitWindow, first: Option<NodeIndex>) -> Option<usize> {
        self.line.answer(monotonic_ns(), first, tx_window, || self.works.now_ns())
    }

    fn take_time(&mut self, most: usize, left: impl FnMut(SentId, Stamp)) {
        self.works.take(most, left);
        if let Some(stranger) = self.works.refuses() {
            self.line.refuse(monotonic_ns(), stranger);
        }
    }

    fn tidy(&mut self, now_ns: u64) {
        self.line.look(now_ns);
        self.wire.deliver(now_ns);
    }

    fn publish(&mut self, scheduler: &SlotScheduler, log: &WindowLog) {
        self.works.publish();
        let Self { works, line, snapshot, state, .. } = self;
        let (before, silent) = (snapshot.silent, scheduler.silent());
        speech::tell_change(before, silent, || line.parted_by(works.clock.parted_by(works.now_ns())));
        let (counts, lead_ns) = (scheduler.counts(&works.clock), scheduler.lead_ns());
        let WindowLog { held, windows } = *log;
        *snapshot = SlotSnapshot { counts, silent, lead_ns, held, windows, ..*snapshot };
        state.show(snapshot);
    }

    /// Shows how much of the tunnel's packets waits.
    fn queue_changed(&mut self) {
        let bytes = self.outbound.waiting_bytes_of(self.router);
        self.shared.tunnel_bytes.store(bytes, Ordering::Relaxed);
    }
}
