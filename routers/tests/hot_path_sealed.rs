//! Sealing and opening take nothing from the heap: neither what is taken, nor what is rejected, nor a hello that brings
//! about nothing new.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_routers::frame::{FrameHead, FrameKind, HEAD_BYTES};
use rohrpost_routers::security::{Opened, Port, Rejection, TAG_BYTES, Tally};
use rohrpost_testbed::pair::SealedRouter;
use std::time::{Duration, Instant};

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const PACKAGES: u64 = 10_000;

#[test]
fn sealing_and_opening_take_nothing_from_the_heap() {
    let (mut a, mut b) = (SealedRouter::new(0), SealedRouter::new(1));
    a.acquaint(&mut b, 0);
    let mut tally = Tally::new(b.peer_sessions.rejections(Port::Packages));
    let mut sequence = 0;
    for bytes in [64, 1400] {
        let mut room = [0; HEAD_BYTES + 1400 + TAG_BYTES];
        let datagram = &mut room[..HEAD_BYTES + bytes + TAG_BYTES];
        let (mut before, mut took) = (heap_uses(), Duration::ZERO);
        for number in 0..=PACKAGES {
            let begun = Instant::now();
            let head = FrameHead {
                kind: FrameKind::Packages,
                system: 1,
                from: 0,
                to: 1,
                digest: 7,
                incarnation: 100,
                sequence,
            };
            a.sealing.seal(&head, datagram).unwrap();
            let mut altered = [0; HEAD_BYTES + 1400 + TAG_BYTES];
            let altered = &mut altered[..datagram.len()];
            altered.copy_from_slice(datagram);
            altered[datagram.len() - 1] ^= 1;
            let opened = matches!(b.opening.open(datagram), Ok(Opened::Frame(..)));
            took += begun.elapsed();
            assert!(opened);
            assert!(b.opening.open(altered).is_err());
            tally.note(number, Some(0), Rejection::Forged);
            sequence += 1;
            if number == 0 {
                // An incarnation had begun, so keys were derived.
                (before, took) = (heap_uses(), Duration::ZERO);
            }
        }
        assert_eq!(heap_uses() - before, 0);
        println!("{bytes} B sealed and opened: {} ns", took.as_nanos() / u128::from(PACKAGES));
    }
    let before = heap_uses();
    (1..100).for_each(|round| a.acquaint(&mut b, round * 1_000_000_000));
    assert_eq!(heap_uses() - before, 0, "they know each other");
}
