//! What comes in by the port of replicas, and what the thread that takes it has of the simulated computer.

use super::{NodeTime, Replicas};
use crate::sim::packages::address;
use crate::sim::promise::Promise;
use crate::sim::spans::MS;
use crate::sim::station::{Arrived, Io, Origin, STRANGER};
use rohrpost_mailbox::Head;
use rohrpost_routers::counts::Cause;
use rohrpost_routers::driver::{Answer, RxPlatform};
use rohrpost_routers::frame::{FrameHead, NodeIndex, ReplicaFrame};
use rohrpost_routers::inbound::Envelope;
use rohrpost_routers::replication::ReplicaReceiver;
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::security::{Port as RouterPort, Rejection};

/// The thread listens for so long, if nothing comes; and while it waits for parts.
const LISTEN_NS: u64 = 100 * MS;
const LISTEN_SHORTLY_NS: u64 = MS;

struct PartRxSystem<'a, 'b> {
    io: &'a mut Io<'b>,
    receiver: &'a mut ReplicaReceiver,
}

struct RecordDelivery<'a, 'b> {
    io: &'a mut Io<'b>,
    receiver: &'a mut ReplicaReceiver,
}

impl Report for RecordDelivery<'_, '_> {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Deliver for RecordDelivery<'_, '_> {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        Err(NotDelivered::NoMailbox)
    }

    fn replica(&mut self, head: &FrameHead, frame: &ReplicaFrame<'_>) -> bool {
        let (now_ns, time) = (self.io.now.monotonic_ns, NodeTime::of(self.io));
        self.receiver.take(now_ns, || time.at(now_ns), head, frame)
    }

    fn event(&mut self, _: RouterEvent) {}
}

impl RxPlatform for PartRxSystem<'_, '_> {
    fn delivery(&mut self) -> impl Deliver {
        RecordDelivery { io: self.io, receiver: self.receiver }
    }

    fn answer(&mut self, _: Answer) -> bool {
        let text = format!("node {} answers by the port of replicas", self.io.node);
        self.io.oracle.broken(self.io.now, Promise::RecordBounds, text);
        true
    }

    fn ring(&mut self) {}
}

/// Of a peer: datagrams that were taken, those that were damaged, and those that do not open.
#[derive(Clone, Copy, Debug)]
struct TakenCounts {
    taken: u64,
    damaged: u64,
    not_opened: u64,
}

impl Replicas {
    pub(in crate::sim) fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        let (now_ns, arrived_ns) = (io.now.monotonic_ns, arrived.stamp.monotonic_ns);
        if self.driver.passes_over(now_ns.saturating_sub(arrived_ns)) {
            return io.oracle.saw("older than its router");
        }
        let before = self.counted(arrived);
        let mut bytes = arrived.bytes.to_vec();
        let source = arrived.source.map_or(STRANGER, address);
        let envelope = Envelope { source, arrived_ns, bytes: bytes.len() };
        let Self { driver, receiver, .. } = self;
        driver.take(&mut PartRxSystem { io, receiver }, now_ns, &envelope, &mut bytes);
        let after = self.counted(arrived);
        self.check_fate(io, arrived, (before, after));
    }

    /// The thread that receives does what is due; when to ask again.
    pub(in crate::sim) fn receive(&mut self, io: &mut Io<'_>) -> u64 {
        let now_ns = io.now.monotonic_ns;
        let Self { driver, receiver, .. } = self;
        let due_ns = driver.poll(&mut PartRxSystem { io, receiver }, now_ns);
        let time = NodeTime::of(io);
        let waits = self.receiver.poll(now_ns, || time.at(now_ns));
        due_ns.min(now_ns + if waits { LISTEN_SHORTLY_NS } else { LISTEN_NS })
    }

    fn counted(&self, arrived: &Arrived) -> TakenCounts {
        let Some(source) = arrived.source.map(|node| node as NodeIndex) else {
            return TakenCounts { taken: 0, damaged: 0, not_opened: 0 };
        };
        let received = &self.leaving.stats.peer(source).received;
        let rejected = |why| {
            let all = self.leaving.peer_sessions();
            all.map_or(0, |all| all.rejections(RouterPort::Replicas).of(Some(source), why))
        };
        let never = [Rejection::Unsealed, Rejection::OtherKey, Rejection::NotOurs, Rejection::Address];
        TakenCounts {
            taken: received.datagrams.get(),
            damaged: received.damaged.get(),
            not_opened: never.into_iter().map(rejected).sum(),
        }
    }

    /// What was damaged is not taken, nor where datagrams are sealed what somebody made; what a router sent is neither
    /// damaged nor unsealed.
    fn check_fate(&self, io: &mut Io<'_>, arrived: &Arrived, (before, after): (TakenCounts, TakenCounts)) {
        let is_taken = after.taken > before.taken;
        io.oracle.saw(if is_taken { "taken by replicas" } else { "not taken by replicas" });
        match arrived.origin {
            Origin::Damaged if is_taken => {
                let text = format!("node {} takes a datagram that was damaged", io.node);
                io.oracle.broken(io.now, Promise::Records, text);
            }
            Origin::Made if is_taken && io.plan.sealed => {
                let text = format!("node {} takes a datagram that somebody made", io.node);
                io.oracle.broken(io.now, Promise::Records, text);
            }
            Origin::Sent { .. } if after.damaged > before.damaged || after.not_opened > before.not_opened => {
                let text = format!("what node {:?} sent to node {} is {after:?}", arrived.source, io.node);
                io.oracle.broken(io.now, Promise::Rejection, text);
            }
            _ => {}
        }
    }
}
