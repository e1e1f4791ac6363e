//! A part of a record on its way from ring to ring takes nothing from the heap, and gives nothing back to it: sealed or
//! not, and with time slots too, where a thread reads the rings that must not wait for any.

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
use rohrpost_routers::replication::{Describe, ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
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

struct Always;

impl Describe for Always {
    fn number(&self, _: &[u8], _: &str) -> Option<u16> {
        Some(ID.number)
    }
}

struct Parts(ReplicaReceiver);

impl Report for Parts {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Deliver for Parts {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        Err(NotDelivered::NoMailbox)
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        self.0.take(0, || time(1), head, part)
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

/// The way from the router of node 0 to that of node 1.
struct Wire {
    settings: [Settings; 2],
    outbound: Outbound,
    inbound: Inbound,
    seals: Option<(Sealing, Gate)>,
}

impl Wire {
    fn open() -> Self {
        Self::of([0, 1].map(settings))
    }

    /// The two know each other.
    fn sealed(tdma: Option<Tdma>) -> Self {
        let (mut base, mut arm) = (SealedRouter::new(0), SealedRouter::new(1));
        base.acquaint(&mut arm, 0);
        let mut wire = Self::of([0, 1].map(|own| {
            let mut settings = Settings { incarnation: 100 + u64::from(own), tdma: tdma.clone(), ..settings(own) };
            settings.network.security = Security::Keys;
            settings.network.datagram_bytes_max -= TAG_BYTES;
            settings
        }));
        wire.outbound = wire.outbound.sealed(base.peer_sessions.clone());
        let gate = Gate::without_hellos(&arm.peer_sessions, Port::Replicas);
        wire.seals = Some((Sealing::new(&base.peer_sessions, Port::Replicas), gate));
        wire
    }

    fn of(settings: [Settings; 2]) -> Self {
        let [here, there] = settings.each_ref().map(|settings| Stats::new(settings, BEGIN_NS));
        let (outbound, inbound) = (Outbound::new(&settings[0], here), Inbound::new(&settings[1], there));
        Self { outbound, inbound, seals: None, settings }
    }

    /// Looks which peers there are, as routers do before each datagram.
    fn look(&mut self, now_ns: u64, datagram: &mut [u8], parts: &mut Parts) {
        while let OutboundStep::Send { bytes, .. } = self.outbound.poll(now_ns, datagram, parts) {
            self.carry(now_ns, datagram, bytes, parts);
        }
    }

    fn carry(&mut self, now_ns: u64, datagram: &mut [u8], bytes: usize, parts: &mut Parts) {
        let (source, arrived_ns) = (address(0), now_ns);
        let Some((sealing, gate)) = &mut self.seals else {
            let came = Datagram { source, arrived_ns, bytes: &datagram[..bytes] };
            return self.inbound.handle(now_ns, &came, parts);
        };
        let datagram = &mut datagram[..bytes + TAG_BYTES];
        sealing.close(datagram).unwrap();
        let came = Envelope { source, arrived_ns, bytes: datagram.len() };
        assert_eq!(gate.take(now_ns, &came, datagram, &mut self.inbound, parts, &mut []), None);
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
            shape,
            node: 0,
            to: 1 << 1,
            sampling: Sampling::Each,
            changed: false,
            delay_alarm_ns: 5 * MS,
            deadline_ns: 200 * MS,
            level: 18,
        };
        let folder = tempfile::tempdir().unwrap();
        let nodes = ["here", "there"].map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let mut wire = if is_sealed { Wire::sealed(tdma) } else { Wire::open() };
        let [base, arm] = wire.settings.clone();
        let mut sender = ReplicaSender::new(&base, std::slice::from_ref(&replica));
        let mut parts = Parts(ReplicaReceiver::new(&arm, &[replica], join(&nodes[1]), Arc::new(Always)));
        join(&nodes[0]).describe_replicas(ID.name, b"of a camera").unwrap();
        let mut writer = join(&nodes[0]).stream_writer(ID, shape).unwrap();
        sender.look(&join(&nodes[0]), &Always);
        let mut reader = join(&nodes[1]).stream_reader(ID).unwrap();
        let (mut datagram, body, mut before) = ([0; 1472], vec![7; record_bytes as usize], 0);
        for number in 0..RECORDS {
            // The first ones make ring and description.
            if number == 3 {
                before = heap_uses();
            }
            writer.write(Stamp { epoch: 1, ns: 1 + number }, &body).unwrap();
            let mut now_ns = BEGIN_NS + number * MS;
            loop {
                wire.look(now_ns, &mut datagram, &mut parts);
                match sender.poll(now_ns, time, &mut wire.outbound, &mut datagram) {
                    ReplicaStep::Send { bytes, .. } => wire.carry(now_ns, &mut datagram, bytes, &mut parts),
                    ReplicaStep::Wait { .. } => now_ns += MS / 10,
                    ReplicaStep::Idle { .. } => break,
                }
            }
            let Next::Record(record) = reader.try_next().unwrap() else { panic!("record {number} is not there") };
            assert_eq!(record.body(), body);
        }
        assert_eq!(heap_uses(), before, "records of {record_bytes} bytes, sealed: {is_sealed}");
    }
}
