//! Lives of routers, streams and writers: what comes of an earlier one is never taken for what the present one says,
//! and a router that begins anew goes on with the ring that is there.

use super::hostile::{describe, described, part, take_of};
use super::*;
use crate::frame::RecordPart;

const FULL: [u8; 1372] = [4; 1372];

fn newest(holder: &Holder) -> Option<(u64, u32)> {
    let there = holder.ground.node.inspect_stream(ID).unwrap().and_then(|there| there.newest);
    there.map(|newest| (newest.sequence, newest.incarnation))
}

/// A record of one part.
fn whole(generation: u16, sequence: u64) -> RecordPart<'static> {
    RecordPart { generation, sequence, stamp_ns: 100 + sequence, ..part(b"whole") }
}

#[test]
fn what_an_earlier_life_says_is_late() {
    let mut holder = described();
    for (generation, sequence, newest_after, late, why) in [
        (u16::MAX, 5, 5, 0, "the first of all"),
        (u16::MAX - 1, 6, 5, 1, "its stream was made anew since"),
        (0, 7, 7, 1, "generations wrap"),
        (u16::MAX, 8, 7, 2, "that one has ended"),
        (0, 9, 9, 2, "this one has not"),
    ] {
        assert!(take_of(&mut holder, START, 101, whole(generation, sequence)));
        let after = (newest(&holder).map(|(sequence, _)| sequence), holder.lost(ReplicaLoss::Late));
        assert_eq!(after, (Some(newest_after), late), "{generation}, {sequence}: {why}");
    }
    // Nor does it describe anything.
    describe(&mut holder, u16::MAX, 101, &words(2));
    assert_eq!(holder.ground.node.about(CAMERA), Some(words(1)));
    describe(&mut holder, 1, 101, &words(2));
    assert_eq!(holder.ground.node.about(CAMERA), Some(words(2)));
}

#[test]
fn parts_of_two_records_of_one_sequence_are_not_put_together() {
    let (first, rest) = (RecordPart { len: 2000, ..part(&FULL) }, [9; 628]);
    let last = RecordPart { offset: 1372, bytes: &rest, ..first };
    for (router, second, records, why) in [
        (100, last, 1, "both are of one"),
        (100, RecordPart { incarnation: 4, ..last }, 0, "of another writer"),
        (100, RecordPart { stamp_ns: 101, ..last }, 0, "of another time"),
        (100, RecordPart { epoch: 2, ..last }, 0, "of another time"),
        (100, RecordPart { generation: 1, ..last }, 0, "of a stream that was made anew"),
        (101, last, 0, "of another life of its router"),
    ] {
        let mut holder = described();
        assert!(take_of(&mut holder, START, 100, first) && take_of(&mut holder, START, router, second));
        assert_eq!(holder.records(), records, "{why}");
    }
}

/// The ring that is there has 4 to 9; the router knows nothing more of it.
#[test]
fn a_router_that_begins_anew_goes_on_with_its_ring() {
    let begun_anew = || {
        let mut before = described();
        (4..10).for_each(|sequence| assert!(take_of(&mut before, START, 101, whole(5, sequence))));
        let Holder { ground, router } = before;
        drop(router);
        let mut holder = Holder::on(ground, 102, &[image()]);
        describe(&mut holder, 0, 100, &words(1));
        holder
    };
    let mut holder = begun_anew();
    assert!(take_of(&mut holder, START, 101, whole(5, 6)));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Late)), (Some((9, 3)), 1), "it came by a longer way");
    assert!(take_of(&mut holder, START, 101, whole(5, 9)));
    assert_eq!(holder.lost(ReplicaLoss::Duplicate), 1, "it is there");
    assert!(take_of(&mut holder, START, 101, whole(4, 10)));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Late)), (Some((9, 3)), 2), "by that its life is known");
    assert!(take_of(&mut holder, START, 101, whole(5, 10)));
    assert_eq!((newest(&holder), holder.counts().gaps.get()), (Some((10, 3)), 0));

    let mut holder = begun_anew();
    assert!(take_of(&mut holder, START, 101, RecordPart { incarnation: 4, ..whole(6, 9) }));
    assert_eq!(newest(&holder), Some((9, 4)), "it is another record, so the stream was made anew");
    let oldest = holder.ground.node.inspect_stream(ID).unwrap().unwrap().oldest;
    assert_eq!(oldest.map(|oldest| oldest.sequence), Some(9), "and so is the ring");
}

#[test]
fn what_a_router_sampled_out_is_not_compared_with_what_the_one_before_did() {
    let mut holder = described();
    let mut reader = holder.reader();
    for (router, sequence, sampled, missed) in [
        (100, 5, 1000, Missed::default()),
        (101, 9, 2, Missed { lost: 3, ..Missed::default() }),
        (101, 12, 3, Missed { lost: 4, sampled: 1, passed_over: 0 }),
    ] {
        assert!(take_of(&mut holder, START, router, RecordPart { sampled, ..whole(0, sequence) }));
        read(&mut reader);
        assert_eq!(reader.missed(), missed, "record {sequence}");
    }
}

/// A module of this node writes a stream of that name.
#[test]
fn a_ring_that_cannot_be_had_is_asked_for_once_a_second() {
    let mut holder = described();
    let writer = holder.ground.join().stream_writer(ID, SHAPE).unwrap();
    assert!(take_of(&mut holder, START, 100, whole(0, 5)));
    assert_eq!(holder.lost(ReplicaLoss::Unwritable), 1);
    drop(writer);
    assert!(take_of(&mut holder, START + 999 * MS, 100, whole(0, 6)));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Unwritable)), (None, 2));
    assert!(take_of(&mut holder, START + 1000 * MS, 100, whole(0, 7)));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Unwritable)), (Some((7, 3)), 2));
}
