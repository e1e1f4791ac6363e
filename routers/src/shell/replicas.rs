//! The two threads of replicas: one reads this node's streams and sends their parts, the other writes what comes from
//! other nodes into rings of this one. Both ends have both: a part that is lost is asked for. Requests go from the
//! thread that receives to the one that sends through queues, and wake it.
//!
//! They have sockets and a port of their own, so a flood of parts takes no room in a socket, and no time of a thread,
//! from packages; where datagrams are sealed, they have keys and sequences of their own ([`Port::Replicas`]). One
//! thread seals and sends whatever leaves by that port, the other opens whatever comes: so parts may go either way, and
//! an answer to one back. Both are scheduled like modules that are not real time. What is sent, and when, says the
//! [driver](crate::driver); what becomes a record says [`replication`](crate::replication).
//!
//! With time slots the thread of the slots sends the parts, by the same port, and the first thread here only looks for
//! the streams: that takes system calls, for which a slot has no time.

use super::rx_thread::{RxSystem, RxThread};
use super::sending::{NoPackages, Sending};
use super::slots::SlotParts;
use super::socket::{InSocket, REPLICA_BYTES};
use super::threads::Shared;
use super::wire::PeerSockets;
use super::{Shell, ShellError};
use crate::counts::Cause;
use crate::driver::{OutletStep, ReplicaDriver, RxDriver, part_queue};
use crate::frame::{FrameHead, NodeIndex, ReplicaFrame};
use crate::impair;
use crate::replication::{Describe, OneWayClock, ReplicaCounts, ReplicaReceiver, ReplicaSender, ReplicaSettings};
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::security::{Gate, Port, Sealing};
use crate::stats::Stats;
use rohrpost_mailbox::{Head, Name, Node, Participant, monotonic_ns, wait_any};
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Modules that have begun are looked for this often, ns.
const LOOK_EVERY_NS: u64 = 500_000_000;
/// With time slots, the end of the router is looked at this often.
const END_EVERY: Duration = Duration::from_millis(50);

/// What replicas need.
pub struct ReplicaParts<'a> {
    /// All of the installation.
    pub replicas: &'a [ReplicaSettings],
    /// Reads descriptions.
    pub describe: Arc<Describe>,
    /// The socket, if it is kept for the router; else it makes one.
    pub socket: Option<OwnedFd>,
    /// A bad network between it and its sockets.
    pub impair: Option<impair::ImpairmentSettings>,
}

/// Writes parts that come.
struct ReplicaDelivery {
    receiver: ReplicaReceiver,
    clock: OneWayClock,
    /// The thread that sends, with the bell that wakes it; none: it is that of the time slots, which nobody wakes.
    sending: Option<Arc<Participant>>,
}

impl ReplicaDelivery {
    /// Wakes the thread that sends, if there is something for it.
    fn ring(&mut self) {
        if self.receiver.must_ring() {
            self.sending.iter().for_each(|sending| sending.ring());
        }
    }
}

impl Report for ReplicaDelivery {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Deliver for ReplicaDelivery {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        Err(NotDelivered::NoMailbox)
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        let is_taken = self.receiver.take(monotonic_ns(), || self.clock.now(), head, part);
        self.ring();
        is_taken
    }

    fn poll(&mut self, now_ns: u64) -> bool {
        let waits = self.receiver.poll(now_ns, || self.clock.now());
        self.ring();
        waits
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// State of the sending thread.
struct ReplicaTx {
    shared: Arc<Shared>,
    participant: Arc<Participant>,
    describe: Arc<Describe>,
    driver: ReplicaDriver,
    sender: ReplicaSender,
    sending: Sending<NoPackages>,
    clock: OneWayClock,
}

impl ReplicaTx {
    /// Runs until the router ends.
    fn run(mut self) {
        let mut look_ns = 0;
        while !self.shared.ends() {
            let now_ns = monotonic_ns();
            if now_ns >= look_ns {
                look_ns = now_ns + LOOK_EVERY_NS;
                self.sender.look(&self.participant, &*self.describe);
            }
            match self.driver.poll(&mut self.sending, |ns| self.clock.at(ns), &mut self.sender) {
                OutletStep::Again => {}
                OutletStep::Sleep { for_ns } => std::thread::sleep(Duration::from_nanos(for_ns)),
                OutletStep::Wait { for_ns } => self.wait(Duration::from_nanos(for_ns)),
            }
        }
    }

    /// Sleeps until there is a record or a request.
    fn wait(&mut self, time: Duration) {
        let (mut readers, has_requests) = self.sender.waits_on();
        let has_more = || self.shared.ends() || has_requests();
        if readers.is_empty() {
            self.participant.wait(time, has_more);
        } else {
            wait_any(&mut readers, time, has_more);
        }
    }
}

/// State of the thread in its place where there are time slots.
struct StreamFinder {
    shared: Arc<Shared>,
    participant: Arc<Participant>,
    describe: Arc<Describe>,
    /// The thread of the slots has it, too.
    sender: Arc<Mutex<ReplicaSender>>,
}

impl StreamFinder {
    /// Runs until the router ends.
    fn run(self) {
        let mut look_ns = 0;
        while !self.shared.ends() {
            // If it waited for the lock, the other would have to wake it in a slot.
            if monotonic_ns() >= look_ns
                && let Ok(mut sender) = self.sender.try_lock()
            {
                sender.look(&self.participant, &*self.describe);
                look_ns = monotonic_ns() + LOOK_EVERY_NS;
            }
            std::thread::sleep(END_EVERY);
        }
    }
}

impl Shell {
    /// Starts the two threads, if this node writes or has a replica.
    ///
    /// # Errors
    /// [`ShellError`]
    pub fn replicate(&mut self, node: &Arc<Node>, parts: ReplicaParts<'_>) -> Result<(), ShellError> {
        let (settings, shared) = (self.settings.clone(), self.shared.clone());
        let [sending, receiving] = [Participant::join(node, Name::NONE)?, Participant::join(node, Name::NONE)?];
        let mut sender = ReplicaSender::new(&settings, parts.replicas);
        let receiver = ReplicaReceiver::new(&settings, parts.replicas, receiving, parts.describe.clone());
        let receiver = receiver.asking_by(sender.requests());
        self.replicas = ReplicaCounts { sent: sender.counts(), received: receiver.counts() };
        if sender.is_empty() {
            return Ok(());
        }
        let stats = Stats::of_port(Port::Replicas, &settings, &self.stats);
        self.replica_stats = Some(stats.clone());
        let round_trip = self.clock.as_ref().map(|clock| clock.round_trip().clone()).unwrap_or_default();
        let awaits = self.slot_parts.is_none().then(|| sending.clone());
        let delivery =
            ReplicaDelivery { receiver, clock: OneWayClock::open(node, round_trip.clone()), sending: awaits };
        self.receive_replicas(delivery, &stats, parts.socket)?;
        let before = (&self.stats, self.rest_stats.as_ref());
        let outbound = part_queue(&settings, &sender, stats, before, self.peer_sessions.as_ref());
        let sealing = self.peer_sessions.as_ref().map(|all| Sealing::new(all, Port::Replicas));
        let port = settings.network.replica_port();
        let wire = PeerSockets::new(&settings, port, sealing, parts.impair, &self.failures);
        let (participant, describe, clock) = (sending, parts.describe, OneWayClock::open(node, round_trip));
        let sending = Sending { outbound, answers: NoPackages, wire, rest: None };
        if let Some(slots) = self.slot_parts.take() {
            let sender = Arc::new(Mutex::new(sender));
            // It has room for one. If that thread has ended, the router is about to.
            let _ = slots.try_send(SlotParts { sender: sender.clone(), sending, clock });
            let finder = StreamFinder { shared, participant, describe, sender };
            return self.begin_below("replicas-out", move || finder.run());
        }
        let driver = ReplicaDriver::new(&settings);
        let tx_thread = ReplicaTx { participant, describe, driver, sender, sending, clock, shared };
        self.begin_below("replicas-out", move || tx_thread.run())
    }

    /// Opens the port, and starts the thread that writes what comes.
    fn receive_replicas(
        &mut self,
        delivery: ReplicaDelivery,
        stats: &Arc<Stats>,
        kept: Option<OwnedFd>,
    ) -> Result<(), ShellError> {
        let settings = self.settings.clone();
        let own = (settings.nodes[usize::from(settings.own)].address, settings.network.replica_port()).into();
        let socket = Arc::new(InSocket::kept(kept, own, &settings.peer_addresses(), REPLICA_BYTES)?);
        self.sockets.push(socket.clone());
        let gate = self.peer_sessions.as_ref().map(|all| Gate::without_hellos(all, Port::Replicas));
        let rx_thread = RxThread {
            driver: RxDriver::new(&settings, stats, gate).of_rest(),
            stats: stats.clone(),
            system: RxSystem { shared: self.shared.clone(), socket, delivery, settings, answers: None },
        };
        self.begin_below("replicas-in", move || rx_thread.run())
    }

    /// Counters of datagrams, as [`stats`](Shell::stats), for replicas, which have threads and a port of their own; no
    /// package is among them.
    pub fn replica_stats(&self) -> Option<&Arc<Stats>> {
        self.replica_stats.as_ref()
    }

    /// Counters of the replicas of this node.
    pub fn replicas(&self) -> &ReplicaCounts {
        &self.replicas
    }
}
