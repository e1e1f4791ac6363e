//! From the node that writes a stream to one that has it by another: what is missing there has its cause.

use super::by_line::{self, carry_one, skipped};
use super::{CAMERA, Ground, ID, SHAPE, at, image, sequences, words};
use crate::frame::NodeIndex;
use crate::harness::{MS, START};
use crate::replication::{LineReplicas, ReplicaSettings};
use rohrpost_config::Sampling;
use rohrpost_mailbox::Missed;

const ORIGIN: NodeIndex = 0;
const BETWEEN: NodeIndex = 1;
const LAST: NodeIndex = 2;

/// A node that has a stream from one, and sends it to another.
fn end(ground: &Ground, own: NodeIndex, sampling: Sampling) -> LineReplicas {
    let replica = |node, to| ReplicaSettings { node, to, sampling, ..image() };
    let sent = if own == LAST { replica(NodeIndex::MAX, 0) } else { replica(own, 1 << (own + 1)) };
    let received = if own == ORIGIN { replica(NodeIndex::MAX, 0) } else { replica(own - 1, 1 << own) };
    by_line::end(ground, own, sent, received)
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
    let mut came = Vec::new();
    // Of 0, 5, 10, 15, ... the one with 15 is passed over: the second line is slow then.
    for number in 0..=20 {
        let now_ns = START + number * MS;
        writer.write(at(100 + number), b"picture").unwrap();
        while carry_one(now_ns, (ORIGIN, &mut origin), (BETWEEN, &mut between)) {}
        let is_fast = number < 15 || number == 20;
        while is_fast && carry_one(now_ns, (BETWEEN, &mut between), (LAST, &mut last)) {}
        came.extend(sequences(&mut reader));
    }
    assert_eq!(came, [0, 5, 10, 20]);
    assert_eq!((skipped(&origin), skipped(&between)), ([16, 0], [0, 1]), "each counts what it leaves out itself");
    assert_eq!(reader.missed(), Missed { lost: 1, sampled: 16, passed_over: 0 });
}
