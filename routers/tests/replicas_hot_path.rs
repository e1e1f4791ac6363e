//! A part of a record on its way from ring to ring takes nothing from the heap, and gives nothing back to it: with time
//! slots too, where a thread reads the rings that must not wait for any.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Head, Name, Next, Node, Participant, Stamp, StreamId, StreamShape, SystemTime};
use rohrpost_network::{Tdma, TimeSlot};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::{FrameHead, NodeIndex, ReplicaFrame};
use rohrpost_routers::inbound::{Datagram, Inbound};
use rohrpost_routers::outbound::Outbound;
use rohrpost_routers::replication::{Describe, ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::pair::{address, settings};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;
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

/// Records of both kinds of memory: of words, and of plain bytes.
#[test]
fn parts_take_nothing_from_the_heap() {
    for (record_bytes, tdma) in [(64, None), (10_000, None), (10_000, Some(slots()))] {
        let shape = StreamShape { record_bytes, keep: 8, readers: 2, late: Duration::ZERO };
        let replica = ReplicaSettings {
            from: ID.name,
            item: "image".into(),
            shape,
            node: 0,
            to: 1 << 1,
            sampling: Sampling::Each,
            delay_alarm_ns: 5 * MS,
            level: 18,
        };
        let folder = tempfile::tempdir().unwrap();
        let nodes = ["here", "there"].map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let [base, arm] = [0, 1].map(|own| Settings { tdma: tdma.clone(), ..settings(own) });
        let begin_ns = 1000 * MS;
        let mut sender = ReplicaSender::new(&base, std::slice::from_ref(&replica));
        let mut outbound = Outbound::new(&base, Stats::new(&base, begin_ns));
        let receiver = ReplicaReceiver::new(&arm, &[replica], join(&nodes[1]), Arc::new(Always));
        let (mut inbound, mut parts) = (Inbound::new(&arm, Stats::new(&arm, begin_ns)), Parts(receiver));
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
            let mut now_ns = begin_ns + number * MS;
            loop {
                match sender.poll(now_ns, time, &mut outbound, &mut datagram) {
                    ReplicaStep::Send { bytes, .. } => {
                        let came = Datagram { source: address(0), arrived_ns: now_ns, bytes: &datagram[..bytes] };
                        inbound.handle(now_ns, &came, &mut parts);
                    }
                    ReplicaStep::Wait { .. } => now_ns += MS / 10,
                    ReplicaStep::Idle { .. } => break,
                }
            }
            let Next::Record(record) = reader.try_next().unwrap() else { panic!("record {number} is not there") };
            assert_eq!(record.body(), body);
        }
        assert_eq!(heap_uses(), before, "records of {record_bytes} bytes");
    }
}
