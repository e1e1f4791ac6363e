//! From the node that writes a stream to one that has it by another: what is missing there has its cause.

use super::{CAMERA, FirstByte, Ground, ID, SHAPE, at, image, time, words};
use crate::frame::{DescriptionPart, FrameKind, NodeIndex, RecordPart, ReplicaFrame};
use crate::harness::{MS, START};
use crate::replication::{LINE_PART_ROOM, LineReplicas, LineSettings, ReplicaLoss, ReplicaSettings};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Missed, Next};
use std::sync::Arc;

const ORIGIN: NodeIndex = 0;
const BETWEEN: NodeIndex = 1;
const LAST: NodeIndex = 2;

/// A node that has a stream from one, and sends it to another.
fn end(ground: &Ground, own: NodeIndex, sampling: Sampling) -> LineReplicas {
    let replica = |node, to| ReplicaSettings { node, to, sampling, ..image() };
    let sent = if own == LAST { replica(NodeIndex::MAX, 0) } else { replica(own, 1 << (own + 1)) };
    let received = if own == ORIGIN { replica(NodeIndex::MAX, 0) } else { replica(own - 1, 1 << own) };
    let (sent, received) = (vec![sent], vec![received]);
    let settings = LineSettings { own, server: BETWEEN, nodes: Vec::new(), sent, received };
    LineReplicas::new(&settings, ground.join(), Arc::new(FirstByte), Box::new(time))
}

/// All that a node has for the next one arrives there.
fn carry(now_ns: u64, from: NodeIndex, here: &mut LineReplicas, there: &mut LineReplicas) {
    let mut content = [0; LINE_PART_ROOM];
    here.refresh(now_ns);
    while let Some((kind, length)) = here.next(now_ns, from + 1, &mut content) {
        let part = match kind {
            FrameKind::RecordPart => ReplicaFrame::Record(RecordPart::parse(&content[..length]).unwrap()),
            _ => ReplicaFrame::Description(DescriptionPart::parse(&content[..length]).unwrap()),
        };
        there.take(now_ns, (Some(from), 7), &part);
    }
}

#[test]
fn what_sampling_leaves_out_on_the_first_hop_is_told_so_behind_the_second_one() {
    let grounds = [Ground::new(), Ground::new(), Ground::new()];
    let mut origin = end(&grounds[0], ORIGIN, Sampling::Every(5));
    let mut between = end(&grounds[1], BETWEEN, Sampling::Each);
    let mut last = end(&grounds[2], LAST, Sampling::Each);
    grounds[0].join().describe_replicas(CAMERA, &words(1)).unwrap();
    let mut writer = grounds[0].join().stream_writer(ID, SHAPE).unwrap();
    let mut reader = grounds[2].join().stream_reader(ID).unwrap();
    origin.refresh(START);
    origin.came(START, BETWEEN);
    between.came(START, LAST);
    let mut sequences = Vec::new();
    // Of 0, 5, 10, 15, ... the one with 15 is passed over: the second line is slow then.
    for number in 0..=20 {
        let now_ns = START + number * MS;
        writer.write(at(100 + number), b"picture").unwrap();
        carry(now_ns, ORIGIN, &mut origin, &mut between);
        if number < 15 || number == 20 {
            carry(now_ns, BETWEEN, &mut between, &mut last);
        }
        loop {
            match reader.try_next().unwrap() {
                Next::Record(record) => sequences.push(record.info().sequence),
                Next::Lost(_) => {}
                Next::Nothing => break,
            }
        }
    }
    assert_eq!(sequences, [0, 5, 10, 20]);
    let lost = |line: &LineReplicas| {
        [ReplicaLoss::Sampled, ReplicaLoss::Passed].map(|cause| line.counts().sent[0].lost.of(cause))
    };
    assert_eq!((lost(&origin), lost(&between)), ([16, 0], [0, 1]), "each counts what it leaves out itself");
    assert_eq!(reader.missed(), Missed { lost: 1, sampled: 16, passed_over: 0 });
}
