//! A package on its way through two routers takes nothing from the heap: neither alone, nor in a crowd, nor in parts,
//! nor sealed, nor in time slots.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
mod common;

use common::{PATIENCE, Pair, Side, label, module, turns};
use rohrpost_mailbox::{BODY_BYTES_MAX, Receiver, SendError, Sender, Shape};
use rohrpost_routers::security::Port;
use rohrpost_routers::stats::Stats;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Uses of the heap by all threads: those of the routers, and the test's, which makes none while it counts.
static USES: AtomicU64 = AtomicU64::new(0);

struct Counting;

#[global_allocator]
static HEAP: Counting = Counting;

// SAFETY: hands all on to the system's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        USES.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as promised by our caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USES.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as promised by our caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Sends even if the router's mailbox is full just now.
fn send(sender: &mut Sender, priority: u8, id: u16, body: &[u8]) {
    loop {
        match sender.send(&label(module(0), priority, id), &[body]) {
            Ok(()) => return,
            Err(SendError::Full(_)) => std::thread::yield_now(),
            Err(error) => panic!("{error}"),
        }
    }
}

fn round(sender: &mut Sender, receiver: &mut Receiver, large: &[u8]) {
    // Alone, so it leaves at once.
    send(sender, 100, 0, b"alone");
    assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().body(), b"alone");
    // Together, so some wait and share a datagram, while a large one leaves in parts.
    send(sender, 20, 1, large);
    (0..40).for_each(|id| send(sender, 100, id, b"one of many"));
    let mut bytes = 0;
    for _ in 0..41 {
        bytes += receiver.receive_timeout(PATIENCE).unwrap().body().len();
    }
    assert_eq!(bytes, large.len() + 40 * 11);
}

/// All ways of sending in one test, one after the other: all threads of the process are counted.
#[test]
fn no_package_takes_from_the_heap() {
    as_packages_come(&paced(Side::start));
    let sealed = paced(Side::seal);
    as_packages_come(&sealed);
    assert!(sealed.sides[0].shell.as_ref().unwrap().rejections(Port::Packages).is_some());
    drop(sealed);
    in_time_slots();
}

/// Two nodes on a network that a large package keeps busy for a while: what is sent meanwhile waits, however soon the
/// router looks.
fn paced(start: fn(&mut Side)) -> Pair {
    let mut pair = Pair::new();
    for side in &mut pair.sides {
        side.settings.network.rate_bytes_s = 1 << 25;
        start(side);
    }
    pair
}

fn mailboxes(pair: &Pair) -> (Sender, Receiver) {
    let shape = Shape { slots: 128, body_bytes_max: BODY_BYTES_MAX as u16, ..Shape::default() };
    let receiver = pair.sides[1].receiver(module(1), shape);
    (pair.sides[0].sender(module(1)), receiver)
}

fn as_packages_come(pair: &Pair) {
    let (mut sender, mut receiver) = mailboxes(pair);
    let large = vec![7; 40_000];
    // SenderCache are opened, and room for parts is taken, once.
    (0..50).for_each(|_| round(&mut sender, &mut receiver, &large));
    let before = USES.load(Ordering::SeqCst);
    assert!(before > 0, "counts");
    (0..500).for_each(|_| round(&mut sender, &mut receiver, &large));
    assert_eq!(USES.load(Ordering::SeqCst), before);
    let stats = pair.sides[0].shell.as_ref().unwrap().stats();
    let sent = &stats.peer(1).sent;
    assert_measured(stats);
    assert!(sent.fragments.get() > 500, "in parts");
    assert!(sent.datagrams.get() - sent.fragments.get() < 550 * 41, "some shared a datagram: {sent:?}");
}

/// Each package was measured; the last one perhaps after it had come.
fn assert_measured(stats: &Stats) {
    let (flow, sent) = (&stats.flows.counts()[0], &stats.peer(1).sent.packages);
    let began = Instant::now();
    while flow.latency().count() != sent.get() {
        assert!(began.elapsed() < PATIENCE, "{flow:?}, of {} packages", sent.get());
        std::thread::yield_now();
    }
    assert!(flow.latency().max > Duration::ZERO, "{flow:?}");
}

/// The thread that sends in time slots: synchronisation, questions and answers, packages alone, in company and in
/// parts, and tools that look.
fn in_time_slots() {
    let pair = Pair::with(Some(turns()));
    let (mut sender, mut receiver) = mailboxes(&pair);
    let large = vec![7; 40_000];
    (0..50).for_each(|_| round(&mut sender, &mut receiver, &large));
    let seen = || pair.sides.each_ref().map(|side| side.shell.as_ref().unwrap().slots().unwrap().snapshot());
    let (before, uses) = (seen(), USES.load(Ordering::SeqCst));
    (0..100).for_each(|_| round(&mut sender, &mut receiver, &large));
    assert_eq!(USES.load(Ordering::SeqCst), uses);
    let after = seen();
    assert!(after[0].counts.syncs.sent > before[0].counts.syncs.sent + 50, "{after:?}");
    assert!(after.iter().zip(&before).all(|(after, before)| after.counts.used > before.counts.used + 50), "{after:?}");
    let stats = pair.sides[0].shell.as_ref().unwrap().stats();
    assert_measured(stats);
    assert!(stats.peer(1).sent.fragments.get() > 100, "in parts");
}
