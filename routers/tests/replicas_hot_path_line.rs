//! A part of a record on its way from ring to ring by a session takes nothing from the heap, and gives nothing back to
//! it.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Name, Next, Node, Participant, Stamp, StreamId, StreamShape, SystemTime};
use rohrpost_routers::frame::{FrameKind, NodeIndex, ReplicaFrame};
use rohrpost_routers::replication::{LINE_PART_ROOM, LineReplicas, LineSettings, ReplicaSettings};
use rohrpost_routers::session::frame::{SessionFrameHead, SessionFrameKind, SessionMessage};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;
const ID: StreamId = StreamId { name: Name::new(1, 112, 0, 0), number: 2 };
const RECORDS: u64 = 200;
const SERVER: NodeIndex = 0;
const LAPTOP: NodeIndex = 1;

fn join(node: &Arc<Node>) -> Arc<Participant> {
    Participant::join(node, Name::NONE).unwrap()
}

fn line(own: NodeIndex, node: &Arc<Node>, shape: StreamShape) -> LineReplicas {
    let replica = |to| ReplicaSettings {
        from: ID.name,
        item: "image".into(),
        stream: "camera.0/image".into(),
        shape,
        node: SERVER,
        to,
        sampling: Sampling::Each,
        changed: false,
        delay_alarm_ns: 1000 * MS,
        deadline_ns: 200 * MS,
        level: 18,
    };
    let (sent, received) = if own == SERVER { (1 << LAPTOP, 0) } else { (0, 1 << LAPTOP) };
    let settings = LineSettings {
        own,
        server: SERVER,
        nodes: Vec::new(),
        sent: vec![replica(sent)],
        received: vec![replica(received)],
    };
    let time = |ns| SystemTime { ns, epoch: 1, error: Duration::ZERO, age: Duration::ZERO };
    LineReplicas::new(&settings, join(node), Arc::new(|_: &[u8], _: &str| Some(ID.number)), Box::new(time))
}

/// As a frame of a session.
fn read(kind: FrameKind, content: &[u8]) -> ReplicaFrame<'_> {
    let is_record = kind == FrameKind::RecordPart;
    let kind = if is_record { SessionFrameKind::RecordPart } else { SessionFrameKind::Description };
    let head = SessionFrameHead { kind, hops: 0, length: content.len() };
    match SessionMessage::parse(head, content).unwrap() {
        SessionMessage::Record(part) => ReplicaFrame::Record(part),
        SessionMessage::Description(part) => ReplicaFrame::Description(part),
        other => panic!("{other:?}"),
    }
}

/// Records of both kinds of memory: of words, and of plain bytes.
#[test]
fn parts_take_nothing_from_the_heap() {
    for record_bytes in [64, 10_000] {
        let shape = StreamShape { record_bytes, keep: 8, readers: 2, late: Duration::ZERO };
        let folder = tempfile::tempdir().unwrap();
        let nodes = ["here", "there"].map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let [mut here, mut there] =
            [(SERVER, &nodes[0]), (LAPTOP, &nodes[1])].map(|(own, node)| line(own, node, shape));
        join(&nodes[0]).describe_replicas(ID.name, b"of a camera").unwrap();
        let mut writer = join(&nodes[0]).stream_writer(ID, shape).unwrap();
        let mut reader = join(&nodes[1]).stream_reader(ID).unwrap();
        let (body, mut content) = (vec![7; record_bytes as usize], [0; LINE_PART_ROOM]);
        here.refresh(MS);
        here.came(MS, LAPTOP);
        let (mut before, mut records) = (0, 0);
        for number in 0..RECORDS {
            // The first ones make ring and description.
            if number == 3 {
                before = heap_uses();
            }
            // Modules are looked for now and then, which takes some.
            let now_ns = MS + number;
            writer.write(Stamp { epoch: 1, ns: 1 + number }, &body).unwrap();
            here.refresh(now_ns);
            while let Some((kind, length)) = here.next_before(now_ns, (LAPTOP, u8::MAX), &mut content) {
                there.take(now_ns, (Some(SERVER), 1), &read(kind, &content[..length]));
            }
            let Next::Record(record) = reader.try_next().unwrap() else { panic!("record {number} is not there") };
            assert_eq!(record.body(), body);
            records += 1;
        }
        assert_eq!(heap_uses(), before, "records of {record_bytes} bytes");
        assert_eq!(records, RECORDS);
    }
}
