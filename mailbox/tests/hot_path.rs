//! Sending and receiving take nothing from the heap, and give nothing back to it.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;
#[path = "../../benches/src/counting.rs"]
pub mod counting;

use common::crew::{Actor, alone, master};
use common::hands::{OPERATIONS, do_all};
use common::{Ground, HIGH, LOW, MAILBOX, label, shape, tell};
use counting::{CountingHeap, heap_uses};
use rohrpost_mailbox::{Interest, OverflowPolicy, Shape, Waiting, Watches};
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

#[test]
fn role() {
    let Some((_, ground)) = common::role() else { return };
    let around = |at: usize, operate: &mut dyn FnMut()| {
        let before = heap_uses();
        operate();
        assert_eq!(heap_uses(), before, "{}: used the heap", OPERATIONS[at].name);
    };
    let start = || assert!(heap_uses() > 0, "counts");
    master(|| do_all(&ground, start, around, Actor::finish));
    tell("done");
}

#[test]
fn no_hot_path_touches_the_heap_also_when_somebody_sleeps() {
    alone(&Ground::in_memory(), "all operations");
}

#[test]
fn many_types_and_other_descriptors_do_not_touch_the_heap() {
    a_round_again_and_again(OverflowPolicy::Displace);
    a_round_again_and_again(OverflowPolicy::Latest);
}

fn a_round_again_and_again(full: OverflowPolicy) {
    let (ground, node) = Ground::made();
    let mut receiver = ground.join().receiver(MAILBOX, Shape { full, ..shape(8) }).unwrap();
    let mut sender = ground.sender();
    let (_far, near) = std::os::unix::net::UnixStream::pair().unwrap();
    let mut watches = Watches::new(receiver.participant()).unwrap();
    watches.add(&near, Interest::Both).unwrap();
    let clock = rohrpost_mailbox::SystemClock::open(&node);
    let mut publications = rohrpost_mailbox::Publications::new(&ground.join());
    let mut round = |id: u16, sender: &mut rohrpost_mailbox::Sender, receiver: &mut rohrpost_mailbox::Receiver| {
        for number in 1..=9 {
            // More types than a sender remembers, so that it looks for their rows, too.
            let kind = rohrpost_mailbox::Type::command(number);
            let label = rohrpost_mailbox::Label { kind, ..label(LOW, id) };
            let _ = sender.send(&label, &[b"parts", b"of a body"]);
            let _ = sender.send(&label, &[b"the newer"]);
            publications.published(MAILBOX, rohrpost_mailbox::Type::data(number), 10, Duration::ZERO);
        }
        sender.send(&label(HIGH, id), &[b"displaces"]).unwrap();
        drop(sender.loan(HIGH));
        sender.loan(HIGH).unwrap().send(&label(HIGH, id), 10).unwrap();
        let mut all = 0;
        while let Some(package) = receiver.try_receive() {
            all += package.body().len();
        }
        assert!(all > 0 && receiver.receive_timeout(Duration::from_micros(1)).is_none());
        let spinning = Waiting { spin: Duration::from_micros(2), ..Duration::from_micros(3).into() };
        assert!(receiver.receive_timeout(spinning).is_none());
        watches.wait_any(&mut [receiver], Duration::from_micros(1), || false);
        assert!(watches.next_ready().is_some_and(|ready| ready.writable));
        receiver.participant().ring();
        node.announce_death();
        let _ = clock.now();
    };
    round(0, &mut sender, &mut receiver);
    let before = heap_uses();
    assert!(before > 0, "counts");
    (1..1000).for_each(|id| round(id, &mut sender, &mut receiver));
    assert_eq!(heap_uses(), before);
}
