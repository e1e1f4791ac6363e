//! The older of two open records: when it holds up the newer one, and when it does no more.

use super::hostile::{described, part, take_of};
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
