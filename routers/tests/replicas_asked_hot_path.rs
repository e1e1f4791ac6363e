//! A part of a record that was lost, and is asked for and sent again, takes nothing from the heap, and gives nothing back
//! to it.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Head, Name, Next, Node, Participant, Stamp, StreamId, StreamShape, SystemTime};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::{FrameHead, NodeIndex, ReplicaFrame};
use rohrpost_routers::inbound::{Datagram, Inbound};
use rohrpost_routers::outbound::Outbound;
use rohrpost_routers::replication::{Describe, ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::pair::{address, settings};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;
const ID: StreamId = StreamId { name: Name::new(1, 112, 0, 0), number: 2 };
const RECORDS: u64 = 200;
const BEGIN_NS: u64 = 1000 * MS;

struct Always;

impl Describe for Always {
    fn number(&self, _: &[u8], _: &str) -> Option<u16> {
        Some(ID.number)
    }
}

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

/// A node's router.
struct End {
    sender: ReplicaSender,
    outbound: Outbound,
    inbound: Inbound,
    parts: Parts,
    datagram: [u8; 1472],
}

impl End {
    fn new(node: &Arc<Node>, index: NodeIndex, replica: &ReplicaSettings) -> Self {
        let (settings, replicas) = (settings(index), std::slice::from_ref(replica));
        let sender = ReplicaSender::new(&settings, replicas);
        let receiver = ReplicaReceiver::new(&settings, replicas, join(node), Arc::new(Always));
        Self {
            parts: Parts(receiver.asking_by(sender.requests()), BEGIN_NS),
            sender,
            outbound: Outbound::new(&settings, Stats::new(&settings, BEGIN_NS)),
            inbound: Inbound::new(&settings, Stats::new(&settings, BEGIN_NS)),
            datagram: [0; 1472],
        }
    }

    /// All that leaves now arrives there, but each datagram of which `loses` says so.
    fn send(&mut self, now_ns: u64, own: NodeIndex, there: &mut Self, mut loses: impl FnMut() -> bool) {
        there.parts.1 = now_ns;
        while let ReplicaStep::Send { bytes, .. } =
            self.sender.poll(now_ns, time, &mut self.outbound, &mut self.datagram)
        {
            if !loses() {
                let came = Datagram { source: address(own), arrived_ns: now_ns, bytes: &self.datagram[..bytes] };
                there.inbound.handle(now_ns, &came, &mut there.parts);
            }
        }
        there.parts.0.poll(now_ns, || time(now_ns));
    }
}

/// Records of both kinds of memory: of words, and of plain bytes.
#[test]
fn parts_that_are_asked_for_take_nothing_from_the_heap() {
    for record_bytes in [64, 10_000] {
        let shape = StreamShape { record_bytes, keep: 8, readers: 2, late: Duration::ZERO };
        let replica = ReplicaSettings {
            from: ID.name,
            item: "image".into(),
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
        let [mut origin, mut holder] = [0, 1].map(|index| End::new(&nodes[usize::from(index)], index, &replica));
        join(&nodes[0]).describe_replicas(ID.name, b"of a camera").unwrap();
        let mut writer = join(&nodes[0]).stream_writer(ID, shape).unwrap();
        origin.sender.look(&join(&nodes[0]), &Always);
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
        assert_eq!(heap_uses(), before, "records of {record_bytes} bytes");
        let counts = holder.parts.0.counts()[0].clone();
        assert!(records > RECORDS - 5 && lost == 0, "{records} records, {lost} lost");
        assert!(counts.completed.get() > 20, "{} completed by asking", counts.completed.get());
    }
}
