//! What a node asks for, when, and how often at most.

use super::hostile::{described, described_by, part, take_of};
use super::*;
use crate::frame::RecordPart;

const FULL: [u8; 1372] = [4; 1372];

/// A part of a record of five.
fn of_five(sequence: u64, index: u32) -> RecordPart<'static> {
    let bytes = if index < 4 { &FULL[..] } else { &FULL[..6000 - 4 * 1372] };
    RecordPart { len: 6000, sequence, offset: index * 1372, stamp_ns: 100 + sequence, bytes, ..part(b"") }
}

/// How many requests leave now.
fn requests(holder: &mut Holder, now_ns: u64) -> usize {
    holder.pass(now_ns);
    std::iter::from_fn(|| holder.router.poll(now_ns).ok()).count()
}

#[test]
fn what_is_known_to_be_lost_is_asked_for_at_once() {
    let mut holder = described();
    for index in [0, 2, 3] {
        assert!(take_of(&mut holder, START, 100, of_five(5, index)));
        assert_eq!(requests(&mut holder, START), 0, "the others may come");
    }
    assert!(take_of(&mut holder, START, 100, of_five(5, 4)));
    assert_eq!((requests(&mut holder, START), holder.counts().asked.get()), (1, 1), "behind the last part");
    let mut holder = described();
    assert!(take_of(&mut holder, START, 100, of_five(5, 0)) && take_of(&mut holder, START, 100, of_five(6, 0)));
    assert_eq!((requests(&mut holder, START), holder.counts().asked.get()), (1, 4), "behind it a newer one begins");
}

#[test]
fn a_record_of_which_nothing_more_comes_is_asked_for_more_and_more_seldom_and_no_more_then() {
    let mut holder = described_by(ReplicaSettings { deadline_ns: u64::MAX, ..image() });
    assert!(take_of(&mut holder, START, 100, of_five(5, 0)));
    let asked_ms: Vec<u64> = (0..2000).filter(|ms| requests(&mut holder, START + ms * MS) > 0).collect();
    assert_eq!(asked_ms[..5], [10, 20, 40, 80, 160], "each time after twice as long");
    let later: usize = (2..1000).map(|second| requests(&mut holder, START + second * 1000 * MS)).sum();
    assert_eq!((asked_ms.len() + later, holder.counts().asked.get()), (32, 32 * 4));
}

#[test]
fn whatever_is_lost_requests_are_bounded() {
    let (mut holder, mut asked) = (described(), 0);
    for step in 0..4000 {
        let now_ns = START + step * MS / 4;
        let whole = RecordPart { sequence: 2 * step + 1, stamp_ns: 100 + step, step: 1, ..part(b"whole") };
        assert!(take_of(&mut holder, now_ns, 100, whole));
        asked += requests(&mut holder, now_ns);
    }
    assert!((500..=531).contains(&asked), "{asked} in a second");
}
