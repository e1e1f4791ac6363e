//! By a session: one record leaves, the newest is next, and sampling is as on the LAN.

use super::{CAMERA, Ground, ID, SHAPE, at, first_byte, image, sequences, time, words};
use crate::frame::{DescriptionPart, FrameKind, NodeIndex, RecordPart, ReplicaFrame};
use crate::harness::{MS, START};
use crate::replication::{LINE_PART_ROOM, LineReplicas, LineSettings, ReplicaLoss, ReplicaSettings};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Missed, StreamReader, StreamWriter};
use rohrpost_network::LEVELS;
use std::sync::Arc;

const SERVER: NodeIndex = 0;
const LAPTOP: NodeIndex = 1;

/// An end of lines, with what it sends and what it has.
pub(super) fn end(ground: &Ground, own: NodeIndex, sent: ReplicaSettings, received: ReplicaSettings) -> LineReplicas {
    let (sent, received) = (vec![sent], vec![received]);
    let settings = LineSettings { own, server: SERVER, nodes: Vec::new(), sent, received };
    LineReplicas::new(&settings, ground.join(), Arc::new(first_byte), Box::new(time))
}

/// The next part arrives, if there is one.
pub(super) fn carry_one(
    now_ns: u64,
    (from, here): (NodeIndex, &mut LineReplicas),
    (to, there): (NodeIndex, &mut LineReplicas),
) -> bool {
    let mut content = [0; LINE_PART_ROOM];
    here.refresh(now_ns);
    let Some((kind, length)) = here.next_before(now_ns, (to, LEVELS as u8), &mut content) else { return false };
    let part = match kind {
        FrameKind::RecordPart => ReplicaFrame::Record(RecordPart::parse(&content[..length]).unwrap()),
        _ => ReplicaFrame::Description(DescriptionPart::parse(&content[..length]).unwrap()),
    };
    there.take(now_ns, (Some(from), 7), &part);
    true
}

/// Records of the first stream that were left out by sampling, and passed over for newer ones.
pub(super) fn skipped(line: &LineReplicas) -> [u64; 2] {
    [ReplicaLoss::Sampled, ReplicaLoss::Passed].map(|cause| line.counts().sent[0].lost.of(cause))
}

/// A line to a laptop.
struct Line {
    here: LineReplicas,
    there: LineReplicas,
    writer: StreamWriter,
    reader: StreamReader,
    now_ns: u64,
    written: u64,
    _grounds: [Ground; 2],
}

impl Line {
    fn new(replica: ReplicaSettings) -> Self {
        let replica = |to| ReplicaSettings { node: SERVER, to, ..replica.clone() };
        let grounds = [Ground::new(), Ground::new()];
        let here = end(&grounds[0], SERVER, replica(1 << LAPTOP), replica(0));
        let there = end(&grounds[1], LAPTOP, replica(0), replica(1 << LAPTOP));
        grounds[0].join().describe_replicas(CAMERA, &words(1)).unwrap();
        let writer = grounds[0].join().stream_writer(ID, SHAPE).unwrap();
        let reader = grounds[1].join().stream_reader(ID).unwrap();
        let mut line = Self { here, there, writer, reader, now_ns: START, written: 0, _grounds: grounds };
        line.here.refresh(START);
        line.here.came(START, LAPTOP);
        line
    }

    /// Writes these, one each millisecond.
    fn write(&mut self, bodies: &[&[u8]]) {
        for body in bodies {
            self.now_ns += MS;
            self.writer.write(at(100 + self.written), body).unwrap();
            self.written += 1;
        }
    }

    /// The next part arrives, if there is one.
    fn carry_one(&mut self) -> bool {
        carry_one(self.now_ns, (SERVER, &mut self.here), (LAPTOP, &mut self.there))
    }

    /// All that leaves arrives; the sequences of what can be read then.
    fn carry(&mut self) -> Vec<u64> {
        while self.carry_one() {}
        self.read()
    }

    /// The sequences of what can be read.
    fn read(&mut self) -> Vec<u64> {
        sequences(&mut self.reader)
    }
}

#[test]
fn the_newest_of_what_waits_leaves_and_what_sampling_leaves_out_is_told_apart() {
    let burst: Vec<&[u8]> = vec![b"picture"; 6];
    for (sampling, changed, first, second, left_out) in [
        (Sampling::Each, false, vec![5], vec![11], [0, 5]),
        // Of 6 to 11 every third is 6 and 9.
        (Sampling::Every(3), false, vec![5], vec![9], [4, 1]),
        (Sampling::Rate(1.0), false, vec![5], vec![], [6, 0]),
        (Sampling::Each, true, vec![5], vec![], [1, 5]),
    ] {
        let mut line = Line::new(ReplicaSettings { sampling, changed, ..image() });
        line.write(&burst);
        assert_eq!(line.carry(), first, "{sampling}, changed: {changed}");
        line.write(&burst);
        assert_eq!(line.carry(), second, "{sampling}, changed: {changed}");
        assert_eq!(skipped(&line.here), left_out, "{sampling}, changed: {changed}");
        line.write(&burst[..1]);
        line.here.refresh(line.now_ns);
        // Twelve is one of three; a second has not passed.
        let waits = !matches!(sampling, Sampling::Rate(_));
        assert_eq!(line.here.waits_for(line.now_ns, LAPTOP), waits, "{sampling}");
        assert!(line.here.is_behind(LAPTOP), "it is looked at nevertheless");
        line.carry();
        assert!(!line.here.waits_for(line.now_ns, LAPTOP) && !line.here.is_behind(LAPTOP), "{sampling}");
        line.write(&burst[..1]);
        line.here.refresh(line.now_ns);
        let waits = waits && sampling != Sampling::Every(3);
        assert_eq!(line.here.waits_for(line.now_ns, LAPTOP), waits, "{sampling}");
    }
    let mut line = Line::new(ReplicaSettings { sampling: Sampling::Every(3), ..image() });
    let sequences: Vec<u64> = (0..10)
        .flat_map(|_| {
            line.write(&[b"picture"]);
            line.carry()
        })
        .collect();
    assert_eq!(sequences, [0, 3, 6, 9]);
    assert_eq!(line.reader.missed(), Missed { lost: 0, sampled: 6, passed_over: 0 });
}

#[test]
fn what_leaves_is_held_and_a_new_connection_begins_with_the_newest() {
    let mut line = Line::new(image());
    line.carry();
    line.write(&[&[1; 6000]]);
    assert!(line.carry_one());
    // The ring turns, more than once.
    for _ in 0..40 {
        line.write(&[&[2; 6000]]);
    }
    assert!(line.carry_one());
    assert_eq!(line.read(), [0], "the one that was begun");
    assert_eq!(line.carry(), [40], "then the newest");
    line.write(&[&[3; 6000]]);
    assert!(line.carry_one());
    for end in [&mut line.here, &mut line.there] {
        end.left(line.now_ns, LAPTOP);
        end.left(line.now_ns, SERVER);
    }
    assert_eq!(line.here.readers().count(), 0, "nobody is woken for it");
    line.write(&[&[4; 6000]]);
    assert_eq!(line.carry(), [], "nothing leaves without a connection");
    line.here.came(line.now_ns, LAPTOP);
    assert_eq!(line.carry(), [42]);
    let received = line.there.counts().received[0].clone();
    assert_eq!((received.records.get(), received.lost.of(ReplicaLoss::Incomplete)), (3, 1));
    // What has left is held no more.
    for _ in 0..40 {
        line.write(&[&[5; 6000]]);
    }
    assert!(line.here.readers().all(|reader| reader.record(42).is_none()));
}

#[test]
fn before_packages_leaves_only_what_is_more_important() {
    let mut line = Line::new(image());
    line.carry();
    line.write(&[b"picture"]);
    line.here.refresh(line.now_ns);
    let mut content = [0; LINE_PART_ROOM];
    for (level, leaves) in [(0, false), (18, false), (19, true)] {
        let part = line.here.next_before(line.now_ns, (LAPTOP, level), &mut content);
        assert_eq!(part.is_some(), leaves, "before packages of level {level}");
    }
}
