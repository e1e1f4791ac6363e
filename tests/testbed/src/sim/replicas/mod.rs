//! Replicas in a simulated network: the cores and drivers of the shell, on rings of real memory, watched.
//!
//! ```text
//!  writers ─▶ Rings: ring of the origin ─▶ Replicas: sender ═ link ═▶ Replicas: receiver ─▶ ring there ─▶ readers
//!     └─────▶ RecordBooks: what was written ◀── each part that leaves, each record that is read ◀───────────┘
//! ```
//!
//! Rings outlive the routers. Here: the two halves of one incarnation of a router. [`FreeReplicas`] runs them where
//! there are no time slots; with them `sim/slotted` does.

mod accounts;
mod books;
mod draw;
mod free;
mod hostile;
mod leaving;
mod modules;
mod receiving;
mod rings;
mod stream;
mod streams;

pub(crate) use books::RecordBooks;
pub(super) use free::FreeReplicas;
pub(crate) use leaving::PORT;
pub(crate) use rings::Rings;
pub(crate) use stream::StreamPlan;
pub(super) use streams::Streams;

use super::clock::Now;
use super::station::Io;
use accounts::Accounts;
use leaving::Leaving;
use rings::stream_number;
use rohrpost_mailbox::{Participant, SystemTime, TimeRecord};
use rohrpost_routers::driver::{RxDriver, part_for_slot, part_queue};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::replication::{ReplicaReceiver, ReplicaSender};
use rohrpost_routers::security::{Gate, PeerSessions, Port as RouterPort, Sealing};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// Modules that have begun are looked for this often, as in the shell, ns.
const LOOK_EVERY_NS: u64 = 500_000_000;

/// One incarnation of a router's replicas.
pub(crate) struct Replicas {
    rings: Rc<Rings>,
    participant: Arc<Participant>,
    sender: ReplicaSender,
    receiver: ReplicaReceiver,
    driver: RxDriver,
    leaving: Leaving,
    accounts: Accounts,
    look_ns: u64,
}

impl Replicas {
    /// An incarnation that begins now. `all`: what its packages count.
    pub(crate) fn new(
        (settings, all): (&Settings, &Arc<Stats>),
        rings: &Rc<Rings>,
        peer_sessions: Option<&Arc<PeerSessions>>,
    ) -> Self {
        let node = usize::from(settings.own);
        let mut sender = ReplicaSender::new(settings, rings.replicas());
        let receiver = ReplicaReceiver::new(settings, rings.replicas(), rings.join(node), Arc::new(stream_number));
        let receiver = receiver.asking_by(sender.requests());
        let stats = Stats::of_port(RouterPort::Replicas, settings, all);
        let gate = peer_sessions.map(|all| Gate::without_hellos(all, RouterPort::Replicas));
        let driver = RxDriver::new(settings, &stats, gate).of_rest();
        let queue = part_queue(settings, &sender, stats.clone(), (all, None), peer_sessions);
        let seals = peer_sessions.map(|all| (Sealing::new(all, RouterPort::Replicas), all.clone()));
        Self {
            participant: rings.join(node),
            leaving: Leaving::new(settings, (all.clone(), stats), (queue, seals), sender.counts()),
            accounts: Accounts::new(sender.counts(), receiver.counts()),
            rings: rings.clone(),
            sender,
            receiver,
            driver,
            look_ns: 0,
        }
    }

    /// Looks which modules have begun, if it is due.
    fn look(&mut self, io: &mut Io<'_>) {
        if io.now.monotonic_ns >= self.look_ns {
            self.look_ns = io.now.monotonic_ns + LOOK_EVERY_NS;
            self.sender.look(&self.participant, &stream_number);
        }
    }

    /// With time slots: the thread that looks for streams has its turn, unless that of the slots has their lock.
    pub(crate) fn find_streams(&mut self, io: &mut Io<'_>) {
        if !io.chance.percent(10) {
            self.look(io);
        }
    }

    /// With time slots: the next part; its receiver and its length.
    pub(crate) fn next_part(&mut self, io: &mut Io<'_>, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        let (time, rings) = (NodeTime::of(io), &self.rings);
        let system = |real_ns| time.at(rings.simulated_ns(real_ns));
        part_for_slot(&mut self.sender, self.leaving.queue(), io.now.monotonic_ns, system, datagram)
    }

    /// With time slots: hands a part to the kernel.
    pub(crate) fn send_part(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: &[u8]) {
        if self.leaving.hand_over(io, to, bytes).is_err() {
            self.leaving.queue().unsent(bytes, &[], &mut leaving::NoPackages);
        }
    }

    /// What must hold at any time.
    pub(crate) fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.accounts.check(io, &self.rings, well);
    }

    /// What must hold at the end.
    pub(crate) fn close(&mut self, io: &mut Io<'_>) {
        self.accounts.close(io, &self.rings);
    }
}

/// System time of a node, as a program there reads it now.
#[derive(Clone, Copy)]
pub(super) struct NodeTime {
    page: Option<TimeRecord>,
    now: Now,
}

impl NodeTime {
    fn of(io: &Io<'_>) -> Self {
        Self::by(io.oracle.times.page(io.now, io.node), io.now)
    }

    pub(super) fn by(page: Option<TimeRecord>, now: Now) -> Self {
        Self { page, now }
    }

    /// At a moment of its monotonic clock.
    pub(super) fn at(&self, monotonic_ns: u64) -> SystemTime {
        match self.page {
            Some(page) => page.at(monotonic_ns),
            None => {
                let ns = self.now.realtime_ns.wrapping_sub(self.now.monotonic_ns).wrapping_add(monotonic_ns);
                SystemTime { ns, epoch: 0, error: Duration::ZERO, age: Duration::ZERO }
            }
        }
    }
}
