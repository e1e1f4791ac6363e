//! Sleeping until there is a package, something else, or no time left.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, OTHER, PATIENCE, label, shape, tell};
use rohrpost_mailbox::{Receiver, wait_above, wait_any};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

const ROUNDS: u16 = 10_000;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "echo");
    let me = ground.join();
    let mut receiver = me.receiver(OTHER, shape(4)).unwrap();
    let mut sender = me.sender(MAILBOX).unwrap();
    tell("ready");
    for id in 0..ROUNDS {
        let package = receiver.receive();
        assert_eq!(package.head().id, id);
        sender.send(&label(HIGH, id), &[package.body()]).unwrap();
    }
}

#[test]
fn no_wake_up_is_ever_lost_between_two_processes() {
    let (ground, me, mut receiver) = Ground::owned(shape(4));
    let echo = ground.start("echo");
    assert_eq!(echo.hear(), "ready");
    let mut sender = me.sender(OTHER).unwrap();
    for id in 0..ROUNDS {
        sender.send(&label(LOW, id), &[&id.to_le_bytes()]).unwrap();
        let package = receiver.receive_timeout(PATIENCE).expect("a wake-up was lost");
        assert_eq!((package.head().id, package.body()), (id, &id.to_le_bytes()[..]));
    }
    echo.finish();
}

#[test]
fn only_what_is_more_important_ends_a_wait_for_it() {
    let (ground, _me, mut receiver) = Ground::owned(shape(8));
    let (mut low, mut high) = (ground.sender(), ground.sender());
    let rounds = std::sync::Barrier::new(2);
    std::thread::scope(|threads| {
        threads.spawn(|| {
            for id in 0..ROUNDS {
                rounds.wait();
                low.send(&label(LOW, id), &[]).unwrap();
                high.send(&label(HIGH, id), &[]).unwrap();
            }
        });
        for id in 0..ROUNDS {
            rounds.wait();
            let began = Instant::now();
            wait_above(&mut receiver, LOW, PATIENCE, || false);
            assert!(began.elapsed() < PATIENCE, "a wake-up was lost");
            for priority in [HIGH, LOW] {
                let package = receiver.try_receive().unwrap();
                assert_eq!((package.head().priority, package.head().id), (priority, id));
            }
        }
    });
    // What it did not sleep a busy computer may have taken from it.
    assert!(wait_above(&mut receiver, LOW, Duration::from_millis(200), || false) >= Duration::from_millis(100));
    assert_eq!(wait_above(&mut receiver, LOW, PATIENCE, || true), Duration::ZERO, "something else is to be done");
}

#[test]
fn no_wake_up_is_lost_among_many_senders() {
    const EACH: u32 = 5_000;
    let (ground, _me, mut receiver) = Ground::owned(shape(4));
    let mut threads = Vec::new();
    for _ in 0..3 {
        let mut sender = ground.sender();
        threads.push(std::thread::spawn(move || {
            for _ in 0..EACH {
                while sender.send(&label(LOW, 0), &[]).is_err() {
                    std::thread::yield_now();
                }
            }
        }));
    }
    for _ in 0..3 * EACH {
        receiver.receive_timeout(PATIENCE).expect("a wake-up was lost");
    }
    threads.into_iter().for_each(|thread| thread.join().unwrap());
    assert!(receiver.try_receive().is_none());
}

#[test]
fn a_timeout_is_kept_and_never_early() {
    let (ground, _me, mut receiver) = Ground::owned(shape(4));
    for timeout in [0, 1, 20].map(Duration::from_millis) {
        let start = Instant::now();
        assert!(receiver.receive_timeout(timeout).is_none());
        assert!(start.elapsed() >= timeout);
    }
    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    assert!(receiver.receive_timeout(Duration::ZERO).is_some(), "what is there needs no time");
    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    assert!(receiver.receive_timeout(Duration::MAX).is_some(), "nor is for ever an overflow");
}

#[test]
fn one_sleep_serves_two_mailboxes() {
    let (ground, me) = Ground::joined();
    let mut first = me.receiver(MAILBOX, shape(4)).unwrap();
    let mut second = me.receiver(OTHER, shape(4)).unwrap();
    let node = ground.node();
    let thread = std::thread::spawn(move || {
        let participant = rohrpost_mailbox::Participant::join(&node, rohrpost_mailbox::Name::NONE).unwrap();
        let mut senders = [MAILBOX, OTHER].map(|name| participant.sender(name).unwrap());
        for id in 0..2_000 {
            let to = usize::from(id % 3 == 0);
            while senders[to].send(&label(LOW, id), &[]).is_err() {
                std::thread::yield_now();
            }
        }
    });
    let deadline = Instant::now() + PATIENCE;
    let (mut from_first, mut from_second) = (0, 0);
    while from_first + from_second < 2_000 {
        assert!(Instant::now() < deadline, "a wake-up was lost");
        wait_any(&mut [&mut first, &mut second], Some(deadline), || false);
        from_first += std::iter::from_fn(|| first.try_receive().map(drop)).count();
        from_second += std::iter::from_fn(|| second.try_receive().map(drop)).count();
    }
    assert_eq!((from_first, from_second), (1_333, 667));
    thread.join().unwrap();
}

#[test]
fn a_ring_ends_a_sleep_for_something_else() {
    let (_ground, me, mut receiver) = Ground::owned(shape(4));
    let (wanted, seen) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)));
    let thread = std::thread::spawn({
        let (wanted, seen) = (wanted.clone(), seen.clone());
        move || {
            for round in 1..=2_000 {
                while wanted.load(Ordering::Acquire) < round {
                    wait_any(&mut [&mut receiver], None, || wanted.load(Ordering::Acquire) >= round);
                }
                seen.store(round, Ordering::Release);
            }
        }
    });
    for round in 1..=2_000 {
        wanted.store(round, Ordering::Release);
        me.ring();
        let start = Instant::now();
        while seen.load(Ordering::Acquire) < round {
            assert!(start.elapsed() < PATIENCE, "a ring was lost");
            std::thread::yield_now();
        }
    }
    thread.join().unwrap();
}

#[test]
fn a_ring_before_the_sleep_is_not_lost() {
    let (_ground, me, mut receiver) = Ground::owned(shape(4));
    let rung = AtomicBool::new(false);
    let start = Instant::now();
    wait_any(&mut [&mut receiver], None, || {
        // As if another thread did it just after this look.
        rung.store(true, Ordering::Release);
        me.ring();
        false
    });
    assert!(rung.load(Ordering::Acquire) && start.elapsed() < PATIENCE);
}

#[test]
fn mailboxes_of_two_participants_cannot_be_waited_for_at_once() {
    let ground = Ground::new();
    let mut first = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let mut second = ground.join().receiver(OTHER, shape(4)).unwrap();
    let both = std::panic::AssertUnwindSafe(|| wait_any(&mut [&mut first, &mut second], None, || true));
    assert!(std::panic::catch_unwind(both).is_err());
    wait_any::<Receiver>(&mut [], None, || false);
}
