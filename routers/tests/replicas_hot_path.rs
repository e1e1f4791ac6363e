//! A part of a record on its way from ring to ring takes nothing from the heap, and gives nothing back to it; nor does
//! one that was lost, and is asked for and sent again: sealed or not, and with time slots too, where a thread reads the
//! rings that must not wait for any.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Head, Name, Next, Node, Participant, Stamp, StreamId, StreamShape, SystemTime};
use rohrpost_network::{Security, Tdma, TimeSlot};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::{FrameHead, NodeIndex, ReplicaFrame};
use rohrpost_routers::inbound::{Datagram, Envelope, Inbound};
use rohrpost_routers::outbound::{Outbound, OutboundStep};
use rohrpost_routers::replication::{ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::security::{Gate, Port, Sealing, TAG_BYTES};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::pair::{SealedRouter, address, settings};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;
const BEGIN_NS: u64 = 1000 * MS;
const ID: StreamId = StreamId { name: Name::new(1, 112, 0, 0), number: 2 };
const RECORDS: u64 = 200;

/// Takes parts at this time, ns.
struct Parts(ReplicaReceiver, u64);

impl Report for Parts {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Deliver for Parts {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        Err(NotDelivered::NoMailbox)
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        self.0.take(self.1, || time(self.1), head, part)
    }

    fn event(&mut self, _: RouterEvent) {}
}

fn time(ns: u64) -> SystemTime {
    SystemTime { ns, epoch: 1, error: Duration::ZERO, age: Duration::ZERO }
}

fn join(node: &Arc<Node>) -> Arc<Participant> {
    Participant::join(node, Name::NONE).unwrap()
}

/// A slot for each node.
fn slots() -> Tdma {
    let us = Duration::from_micros;
    let slot =
        |node: u8| TimeSlot { node, offset: us(1000 + 2000 * u64::from(node)), length: us(1000), period: 1, phase: 0 };
    Tdma {
        cycle: us(5000),
        synchronisation: us(500),
        guard: us(150),
        link_bytes_s: 125_000_000,
        slots: (0..2).map(slot).collect(),
        tunnel: None,
    }
}

/// A node's router.
struct End {
    sender: ReplicaSender,
    outbound: Outbound,
    inbound: Inbound,
    parts: Parts,
    seals: Option<(Sealing, Gate)>,
    datagram: [u8; 1472],
}

impl End {
    fn new(node: &Arc<Node>, settings: &Settings, replica: &ReplicaSettings) -> Self {
        let replicas = std::slice::from_ref(replica);
        let mut sender = ReplicaSender::new(settings, replicas);
        let receiver =
            ReplicaReceiver::new(settings, replicas, join(node), Arc::new(|_: &[u8], _: &str| Some(ID.number)));
        Self {
            parts: Parts(receiver.asking_by(sender.requests()), BEGIN_NS),
            sender,
            outbound: Outbound::new(settings, Stats::new(settings, BEGIN_NS)),
            inbound: Inbound::new(settings, Stats::new(settings, BEGIN_NS)),
            seals: None,
            datagram: [0; 1472],
        }
    }

    /// Those of both nodes.
    fn open(nodes: &[Arc<Node>; 2], replica: &ReplicaSettings) -> [Self; 2] {
        [0, 1].map(|own| Self::new(&nodes[usize::from(own)], &settings(own), replica))
    }

    /// The same, and they know each other.
    fn sealed(nodes: &[Arc<Node>; 2], replica: &ReplicaSettings, tdma: Option<&Tdma>) -> [Self; 2] {
        let (mut base, mut arm) = (SealedRouter::new(0), SealedRouter::new(1));
        base.acquaint(&mut arm, 0);
        [(0, base), (1, arm)].map(|(own, SealedRouter { peer_sessions: all, .. })| {
            let mut settings = Settings { incarnation: 100 + u64::from(own), tdma: tdma.cloned(), ..settings(own) };
            settings.network.security = Security::Keys;
            settings.network.datagram_bytes_max -= TAG_BYTES;
            let mut end = Self::new(&nodes[usize::from(own)], &settings, replica);
            end.outbound = end.outbound.sealed(all.clone());
            end.seals = Some((Sealing::new(&all, Port::Replicas), Gate::without_hellos(&all, Port::Replicas)));
            end
        })
    }

    /// Writes and seals the next datagram; its length.
    fn next(&mut self, now_ns: u64) -> Option<usize> {
        let Self { sender, outbound, parts, datagram, .. } = self;
        // Routers look which peers there are before each.
        let bytes = match outbound.poll(now_ns, datagram, parts) {
            OutboundStep::Send { bytes, .. } => bytes,
            OutboundStep::Wait { .. } => match sender.poll(now_ns, time, outbound, datagram) {
                ReplicaStep::Send { bytes, .. } => bytes,
                ReplicaStep::Wait { .. } | ReplicaStep::Idle { .. } => return None,
            },
        };
        let Some((sealing, _)) = &mut self.seals else { return Some(bytes) };
        sealing.close(&mut self.datagram[..bytes + TAG_BYTES]).unwrap();
        Some(bytes + TAG_BYTES)
    }

    /// All that leaves now arrives there, but each datagram of which `loses` says so.
    fn send(&mut self, now_ns: u64, own: NodeIndex, there: &mut Self, mut loses: impl FnMut() -> bool) {
        there.parts.1 = now_ns;
        while let Some(bytes) = self.next(now_ns) {
            if !loses() {
                there.take(now_ns, own, &mut self.datagram[..bytes]);
            }
        }
        there.parts.0.poll(now_ns, || time(now_ns));
    }

    fn take(&mut self, now_ns: u64, from: NodeIndex, datagram: &mut [u8]) {
        let Self { inbound, parts, seals, .. } = self;
        let (source, arrived_ns) = (address(from), now_ns);
        let Some((_, gate)) = seals else {
            return inbound.handle(now_ns, &Datagram { source, arrived_ns, bytes: datagram }, parts);
        };
        let came = Envelope { source, arrived_ns, bytes: datagram.len() };
        assert_eq!(gate.take(now_ns, &came, datagram, inbound, parts, &mut []), None);
    }
}

/// Records of both kinds of memory: of words, and of plain bytes.
#[test]
fn parts_take_nothing_from_the_heap() {
    let cases = [(64, false, None), (10_000, false, None), (64, true, None), (10_000, true, None)];
    for (record_bytes, is_sealed, tdma) in cases.into_iter().chain([(10_000, true, Some(slots()))]) {
        let shape = StreamShape { record_bytes, keep: 8, readers: 2, late: Duration::ZERO };
        let replica = ReplicaSettings {
            from: ID.name,
            item: "image".into(),
            stream: "camera.0/image".into(),
            shape,
            node: 0,
            to: 1 << 1,
            sampling: Sampling::Each,
            changed: false,
            delay_alarm_ns: 1000 * MS,
            deadline_ns: 200 * MS,
            level: 18,
        };
        let folder = tempfile::tempdir().unwrap();
        let nodes = ["here", "there"].map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let ends = if is_sealed { End::sealed(&nodes, &replica, tdma.as_ref()) } else { End::open(&nodes, &replica) };
        let [mut origin, mut holder] = ends;
        join(&nodes[0]).describe_replicas(ID.name, b"of a camera").unwrap();
        let mut writer = join(&nodes[0]).stream_writer(ID, shape).unwrap();
        origin.sender.look(&join(&nodes[0]), &|_: &[u8], _: &str| Some(ID.number));
        let mut reader = join(&nodes[1]).stream_reader(ID).unwrap();
        let (body, mut before, mut left, mut now_ns) = (vec![7; record_bytes as usize], 0, 0, BEGIN_NS);
        let (mut records, mut lost) = (0, 0);
        for number in 0..RECORDS {
            // The first ones make ring and description.
            if number == 3 {
                before = heap_uses();
            }
            writer.write(Stamp { epoch: 1, ns: 1 + number }, &body).unwrap();
            for _ in 0..6 {
                now_ns += MS / 2;
                origin.send(now_ns, 0, &mut holder, || {
                    left += 1;
                    number >= 3 && left % 7 == 0
                });
                holder.send(now_ns, 1, &mut origin, || false);
            }
            loop {
                match reader.try_next().unwrap() {
                    Next::Record(record) => {
                        assert_eq!(record.body(), body);
                        records += 1;
                    }
                    Next::Lost(more) => lost += more,
                    Next::Nothing => break,
                }
            }
        }
        assert_eq!(
            heap_uses(),
            before,
            "records of {record_bytes} bytes, sealed: {is_sealed}, in slots: {}",
            tdma.is_some()
        );
        let counts = holder.parts.0.counts()[0].clone();
        assert!(records > RECORDS - 5 && lost == 0, "{records} records, {lost} lost");
        assert!(counts.completed.get() > 20, "{} completed by asking", counts.completed.get());
    }
}
