//! Both halves, over a wire in memory: with the outbound and the inbound that ship, and rings of two nodes.

mod asked;
mod asking;
mod by_line;
mod changed;
mod damaged;
mod hops;
mod hostile;
mod joining;
mod lives;
mod lossy;
mod older;
mod reordered;
mod requests;
mod sealed;
mod slow;
mod stage;
mod stepped;
mod turns;
mod two_hops;

use super::{ReceivedReplica, ReplicaLoss, ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use crate::counts::Count;
use crate::frame::{FrameHead, NodeIndex, ReplicaFrame};
use crate::harness::{MS, START, address, settings};
use crate::inbound::{Datagram, Inbound};
use crate::outbound::Outbound;
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{
    Head, Missed, Name, Next, Node, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter, SystemTime,
};
use stage::*;
use std::sync::Arc;
use std::time::Duration;

const CAMERA: Name = Name::new(1, 112, 0, 0);
const NUMBER: u16 = 7;
const ID: StreamId = StreamId { name: CAMERA, number: NUMBER };
const SHAPE: StreamShape = StreamShape { record_bytes: 6000, keep: 16, readers: 3, late: Duration::ZERO };
const ORIGIN: NodeIndex = 0;
const HOLDER: NodeIndex = 1;

/// A description is the number of its stream `image`, and more.
fn first_byte(description: &[u8], item: &str) -> Option<u16> {
    description.first().filter(|_| item == "image").map(|number| u16::from(*number))
}

fn words(of: u8) -> Vec<u8> {
    let mut words = vec![of; 4000];
    words[0] = NUMBER as u8;
    words
}

fn image() -> ReplicaSettings {
    ReplicaSettings {
        from: CAMERA,
        item: "image".into(),
        stream: "camera.0/image".into(),
        shape: SHAPE,
        node: ORIGIN,
        to: 1 << HOLDER,
        sampling: Sampling::Each,
        changed: false,
        delay_alarm_ns: 5 * MS,
        deadline_ns: 200 * MS,
        level: 18,
    }
}

#[test]
fn records_arrive_as_they_were_written() {
    let mut both = Both::new(image());
    for (sequence, len) in (0..).zip([0, 1, 1372, 1373, 6000, 17]) {
        let body: Vec<u8> = (0..len).map(|at| (at * 7 + sequence as usize) as u8).collect();
        both.send(100 + sequence, &body);
        let Next::Record(record) = both.reader.try_next().unwrap() else { panic!("record {sequence} is not there") };
        let there = both.writer.newest().unwrap();
        assert_eq!(record.body(), there.1, "{sequence}");
        let told = |info: rohrpost_mailbox::RecordInfo| (info.sequence, info.stamp, info.incarnation, info.len_bytes);
        assert_eq!(told(record.info()), told(there.0));
    }
    let Both { origin, holder, reader, .. } = both;
    assert_eq!((holder.records(), reader.accounts()), (6, (6, 0)));
    let (sent, received) = (&origin.router.sender.counts()[0], holder.counts());
    let bytes = 1 + 1372 + 1373 + 6000 + 17;
    assert_eq!((sent.records.get(), sent.bytes.get(), received.bytes.get()), (6, bytes, bytes));
    assert_eq!([&received.completed, &received.asked, &received.gaps, &sent.again].map(Count::get), [0; 4]);
    assert_eq!(holder.ground.node.about(CAMERA), Some(words(1)), "its readers know what they read");
    assert!(ReplicaLoss::ALL.iter().all(|cause| holder.lost(*cause) == 0));
}

#[test]
fn a_writer_that_begins_anew_goes_on() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut reader, mut incarnations) = (START, holder.reader(), Vec::new());
    for life in 0..3 {
        let mut writer = origin.writer(ID, SHAPE);
        for step in 0..2 {
            writer.write(at(100 + 10 * life + step), b"picture").unwrap();
            holder.take_all(now_ns, &origin.leave(&mut now_ns));
            let Next::Record(record) = reader.try_next().unwrap() else { panic!("it is there") };
            incarnations.push(record.info().incarnation);
        }
    }
    assert_eq!(reader.accounts(), (6, 0));
    incarnations.dedup();
    assert_eq!(incarnations.len(), 3, "{incarnations:?}");
}

#[test]
fn another_interface_makes_the_replica_anew() {
    let mut both = Both::new(image());
    both.send(100, b"old");
    assert_eq!(both.read().0, [(0, 3)]);
    both.origin.ground.join().describe_replicas(CAMERA, &words(2)).unwrap();
    both.origin.look();
    both.send(101, b"newer");
    assert_eq!(both.holder.ground.node.about(CAMERA), Some(words(2)));
    assert_eq!(both.read().0, [(1, 5)]);
    let there = both.holder.ground.node.inspect_stream(ID).unwrap().unwrap();
    assert_eq!(there.oldest.map(|record| record.sequence), Some(1), "what the new one does not describe is gone");
}

#[test]
fn the_more_important_goes_first_and_no_replica_delays_another() {
    let pose = ReplicaSettings { shape: StreamShape { record_bytes: 64, ..SHAPE }, level: 2, from: POSE, ..image() };
    let replicas = [image(), pose];
    const POSE: Name = Name::new(1, 240, 0, 0);
    let pose_id = StreamId { name: POSE, number: NUMBER };
    let mut origin = Origin::new(&replicas);
    origin.ground.join().describe_replicas(POSE, &words(3)).unwrap();
    origin.look();
    let (mut pictures, mut poses) = (origin.writer(ID, SHAPE), origin.writer(pose_id, replicas[1].shape));
    let mut now_ns = START;
    origin.leave(&mut now_ns);
    pictures.write(at(100), &[1; 6000]).unwrap();
    let place = |datagram: &[u8]| datagram[36];
    now_ns += MS;
    assert_eq!(place(&origin.router.poll(now_ns).unwrap().1), 0);
    poses.write(at(100), &[2; 64]).unwrap();
    let places: Vec<u8> = origin.leave(&mut now_ns).iter().map(|datagram| place(datagram)).collect();
    assert_eq!(places, [1, 0, 0, 0, 0]);
}

#[test]
fn sampling_leaves_out_what_it_says() {
    for (sampling, expected, left_out) in
        [(Sampling::Every(3), vec![0, 3, 6, 9], 6), (Sampling::Rate(250.0), vec![0, 4, 8], 7)]
    {
        let mut both = Both::new(ReplicaSettings { sampling, ..image() });
        for step in 0..10 {
            both.now_ns = START + step * MS;
            both.send(100 + step, &[]);
        }
        let (all, lost) = both.read();
        assert_eq!(all.iter().map(|(sequence, _)| *sequence).collect::<Vec<_>>(), expected, "{sampling}");
        let told: u64 = expected.last().unwrap() + 1 - expected.len() as u64;
        assert_eq!((lost, both.origin.lost(ReplicaLoss::Sampled)), (told, left_out), "{sampling}");
        assert_eq!(both.reader.missed(), Missed { lost: 0, sampled: told, passed_over: 0 }, "{sampling}");
    }
}

#[test]
fn a_wire_that_is_too_slow_carries_the_newest() {
    let mut both = Both::new(image());
    both.carry();
    for step in 0..100 {
        both.writer.write(at(100 + step), &[3; 6000]).unwrap();
        // One part for each record of five.
        if let Ok((_, datagram)) = both.origin.router.poll(both.now_ns + step * MS) {
            both.holder.take(both.now_ns, &datagram);
        }
    }
    both.now_ns += 100 * MS;
    both.carry();
    // Nothing more comes of a record that was overwritten on its way.
    both.holder.pass(both.now_ns + 1000 * MS);
    let ((all, lost), Both { origin, holder, reader, .. }) = (both.read(), both);
    assert_eq!(all.last(), Some(&(99, 6000)));
    assert_eq!(all.len() as u64 + lost, 100, "each is read or told");
    assert!(origin.lost(ReplicaLoss::Passed) >= 60, "{}", origin.lost(ReplicaLoss::Passed));
    assert_eq!(holder.records() + holder.counts().gaps.get(), 100);
    let passed_over = holder.records() - all.len() as u64;
    assert_eq!(reader.missed(), Missed { lost: 100 - holder.records(), sampled: 0, passed_over });
}
