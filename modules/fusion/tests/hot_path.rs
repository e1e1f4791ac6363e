//! Once made, a history and a matcher take nothing from the heap: not for a record, a lookup, a value in between or a
//! set, also when they are full and records come out of order.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use nalgebra::{Isometry3, Vector3};
use rohrpost_fusion::{History, MatchInput, Matcher, Records, Stamp};

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Records come ten at a time, in this order.
const ORDER: [u64; 10] = [0, 2, 1, 3, 5, 4, 9, 7, 8, 6];

#[test]
fn records_lookups_and_sets_do_not_touch_the_heap() {
    let input = |name: &str| MatchInput { name: name.into(), lateness_ns: 50, capacity: 32 };
    let mut matcher = Matcher::new([input("image"), input("scan"), input("pose")], 5);
    let mut history = History::new(64, 50);
    assert!(heap_uses() > 0, "it counts");
    let before = heap_uses();
    let (mut values, mut refused, mut sets) = (0, 0, 0);
    for tens in 0..200 {
        for one in ORDER {
            let sequence = 10 * tens + one;
            let pose = Isometry3::rotation(Vector3::new(0.0, 0.0, 1e-3 * sequence as f64));
            let stamp = Stamp::new(1, 1_000 + 10 * sequence);
            history.push(stamp, sequence, pose).unwrap();
            for asked_ns in [stamp.ns.saturating_sub(105), stamp.ns.saturating_sub(5_000), stamp.ns] {
                match history.at(Stamp::new(1, asked_ns), 100) {
                    Ok(_) => values += 1,
                    Err(_) => refused += 1,
                }
            }
            for stream in 0..3 {
                matcher.push(stream, Stamp { ns: stamp.ns + stream as u64, ..stamp }, sequence, pose).unwrap();
            }
            while matcher.next_set().is_some() {
                sets += 1;
            }
        }
    }
    let uses = heap_uses() - before;
    assert!(values > 1_500 && refused > 1_500 && sets > 1_500, "{values} {refused} {sets}");
    assert_eq!(uses, 0, "uses of the heap");
    // A stream that is silent fills the memory of the others.
    for sequence in 0..100 {
        matcher.push(0, Stamp::new(2, 10 * sequence), sequence, Isometry3::identity()).unwrap();
        // The first of a later epoch settles what this stream had before.
        while matcher.next_set().is_some() {}
    }
    assert_eq!(matcher.missing().map(|missing| missing.stream), Some(1));
    assert_eq!((heap_uses() - before, matcher.waiting(0)), (0, 32));
}
