//! The older of two open records: when it holds up the newer one, and when it does no more.

use super::hostile::{describe, described, part, take_of};
use super::*;
use crate::frame::RecordPart;

const FULL: [u8; 1372] = [4; 1372];

/// A first part of two.
fn first(sequence: u64, stamp_ns: u64) -> RecordPart<'static> {
    RecordPart { len: 2000, sequence, stamp_ns, ..part(&FULL) }
}

fn newest(holder: &Holder) -> Option<u64> {
    holder.ground.node.inspect_stream(ID).unwrap().and_then(|there| there.newest).map(|newest| newest.sequence)
}

#[test]
fn one_that_is_given_up_already_holds_up_nothing() {
    let mut holder = described();
    assert!(take_of(&mut holder, START, 100, first(4, 100)));
    // Nothing came of it for longer than the deadline, and nobody has looked since.
    assert!(take_of(&mut holder, START + 300 * MS, 100, RecordPart { sequence: 5, ..part(b"whole") }));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Incomplete)), (Some(5), 1));
}

#[test]
fn one_of_a_ring_that_is_made_anew_is_given_up_with_it() {
    let mut holder = described();
    assert!(take_of(&mut holder, START, 100, part(b"of the time before")));
    // The origin's router begins anew, and its stream too: the third record is behind what was there.
    for (sequence, stamp_ns) in [(6, 200), (7, 201)] {
        assert!(take_of(&mut holder, START, 101, first(sequence, stamp_ns)));
    }
    assert!(take_of(&mut holder, START, 101, RecordPart { sequence: 8, stamp_ns: 50, ..part(b"whole") }));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Incomplete)), (Some(8), 2));
}

#[test]
fn one_for_which_no_frame_is_free_holds_up_nothing() {
    let mut holder = described();
    let mut readers = [(); 3].map(|()| holder.reader());
    let whole = |sequence| RecordPart { sequence, step: u32::from(sequence > 0), ..part(b"whole") };
    // Each holds another record, and all of them leave the ring.
    (0..3).for_each(|sequence| assert!(take_of(&mut holder, START, 100, whole(sequence))));
    let [_, one, two] = &mut readers;
    one.seek(1);
    two.seek(2);
    let held = readers.each_mut().map(|reader| reader.try_next().unwrap());
    assert!(held.iter().all(|next| matches!(next, Next::Record(_))));
    (3..30).for_each(|sequence| assert!(take_of(&mut holder, START, 100, whole(sequence))));
    // 30 is lost, 32 says so and waits for it. It comes when it is asked for, and there is no room for it.
    assert!(take_of(&mut holder, START, 100, RecordPart { step: 2, ..whole(32) }));
    assert_eq!(newest(&holder), Some(29));
    assert!(take_of(&mut holder, START, 100, RecordPart { step: 0, ..whole(30) }));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Incomplete)), (Some(32), 1));
    drop(held);
}

#[test]
fn of_one_that_was_given_up_what_comes_is_late() {
    let mut holder = described();
    assert!(take_of(&mut holder, START, 100, first(4, 100)));
    assert!(take_of(&mut holder, START + 150 * MS, 100, first(5, 101)));
    assert!(holder.router.receiver.must_ring(), "by the newer one it is known what is missing");
    holder.pass(START + 199 * MS);
    assert!(holder.router.receiver.must_ring(), "it is asked for again");
    assert_eq!(holder.lost(ReplicaLoss::Incomplete), 0);
    holder.pass(START + 200 * MS);
    assert_eq!(holder.lost(ReplicaLoss::Incomplete), 1, "nothing came of it for the deadline");
    let rest = |sequence, stamp_ns| RecordPart { offset: 1372, bytes: &FULL[..628], ..first(sequence, stamp_ns) };
    let now_ns = START + 201 * MS;
    assert!(take_of(&mut holder, now_ns, 100, rest(4, 100)) && take_of(&mut holder, now_ns, 100, rest(5, 101)));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Late)), (Some(5), 1));
}

#[test]
fn one_that_is_given_up_gives_its_frame_back() {
    let mut holder = described();
    // More of them than the ring has frames.
    for sequence in 0..50 {
        let now_ns = START + sequence * 300 * MS;
        assert!(take_of(&mut holder, now_ns, 100, first(2 * sequence, 100)));
        assert!(take_of(&mut holder, now_ns, 100, RecordPart { sequence: 2 * sequence + 1, ..part(b"whole") }));
        holder.pass(now_ns + 250 * MS);
        assert_eq!(newest(&holder), Some(2 * sequence + 1));
    }
    let causes = [ReplicaLoss::Incomplete, ReplicaLoss::Late, ReplicaLoss::Unwritable].map(|cause| holder.lost(cause));
    assert_eq!(causes, [50, 0, 0]);
}

#[test]
fn both_are_given_up_with_their_description() {
    let mut holder = described();
    assert!(take_of(&mut holder, START, 100, first(4, 100)) && take_of(&mut holder, START, 100, first(5, 101)));
    describe(&mut holder, 0, 100, &words(2));
    assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Incomplete)), (None, 2));
}

#[test]
fn one_that_does_not_come_holds_up_the_newer_for_an_answer_and_no_longer() {
    let mut holder = described();
    let whole = |sequence| RecordPart { sequence, step: 1, ..part(b"whole") };
    assert!(take_of(&mut holder, START, 100, RecordPart { step: 0, ..whole(4) }));
    assert!(take_of(&mut holder, START, 100, whole(6)));
    for (after_ns, there, incomplete) in [(0, 4, 0), (10 * MS - 1, 4, 0), (10 * MS + MS / 2, 6, 1)] {
        holder.pass(START + after_ns);
        assert_eq!((newest(&holder), holder.lost(ReplicaLoss::Incomplete)), (Some(there), incomplete), "{after_ns}");
    }
}
