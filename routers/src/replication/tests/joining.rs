//! Nodes that come late, and nodes that are not there.

use super::requests::{ask, request};
use super::*;
use crate::frame::FrameKind;

const PART: u8 = FrameKind::RecordPart as u8;

#[test]
fn a_node_that_comes_late_has_the_newest_at_once() {
    // Whatever the sampling says of the next one.
    for sampling in [Sampling::Each, Sampling::Every(100), Sampling::Rate(0.1)] {
        let mut both = Both::new(ReplicaSettings { sampling, ..image() });
        for step in 0..5 {
            both.writer.write(at(100 + step), b"a map").unwrap();
            both.origin.leave(&mut both.now_ns);
        }
        // Its router is heard for the first time.
        both.origin.router.stats.peer(HOLDER).link.incarnation.set(5);
        both.carry();
        let there = both.holder.ground.node.inspect_stream(ID).unwrap();
        let newest = there.and_then(|there| there.newest).map(|newest| newest.sequence);
        assert_eq!(newest, Some(4), "{sampling}");
        // And again: what it has already is no gap, and not a second record.
        both.origin.router.stats.peer(HOLDER).link.incarnation.set(6);
        both.carry();
        assert_eq!((both.holder.records(), both.holder.lost(ReplicaLoss::Duplicate)), (1, 1), "{sampling}");
    }
}

#[test]
fn what_is_under_way_to_a_node_that_begins_anew_goes_from_its_first_part_on() {
    let mut both = Both::new(image());
    both.origin.leave(&mut both.now_ns);
    both.writer.write(at(100), &[7; 6000]).unwrap();
    assert!(both.origin.router.poll(both.now_ns + MS).is_ok());
    both.writer.write(at(101), b"newer").unwrap();
    both.origin.router.stats.peer(HOLDER).link.incarnation.set(5);
    both.carry();
    assert_eq!(both.read(), (vec![(0, 6000), (1, 5)], 0));
}

#[test]
fn an_absent_node_is_not_waited_for() {
    let replicas = [image()];
    let mut origin = Origin::new(&replicas);
    let (mut now_ns, mut writer) = (START, origin.writer(ID, SHAPE));
    writer.write(at(100), b"picture").unwrap();
    origin.leave(&mut now_ns);
    // The second one is under way, and a part of the first one was asked for.
    writer.write(at(101), &[7; 6000]).unwrap();
    assert!(origin.router.poll(now_ns + MS).is_ok());
    assert!(ask(&mut origin, HOLDER, request(0, &[0])));
    let silent_ns = now_ns + 2000 * MS;
    let mut datagram = vec![0; 1472];
    for step in 0..10 {
        writer.write(at(200 + step), b"picture").unwrap();
        let Router { sender, outbound, .. } = &mut origin.router;
        let waits = sender.poll(silent_ns + step, time, outbound, &mut datagram);
        assert!(matches!(waits, ReplicaStep::Idle { .. }), "{waits:?}");
    }
    assert_eq!(origin.lost(ReplicaLoss::Absent), 10, "the newest is for when it is there again");
    now_ns = silent_ns + MS;
    let left = origin.leave(&mut now_ns);
    let records: Vec<u8> = left.iter().filter(|datagram| datagram[3] == PART).map(|datagram| datagram[56]).collect();
    assert_eq!(records, [11], "and nothing of what was asked for before");
    let sent = origin.router.sender.counts()[0].records.get();
    assert_eq!(sent + origin.lost(ReplicaLoss::Absent), writer.written(), "each is sent, or counted");
}
