//! Sleeping for mailboxes and file descriptors at once.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, LOW, MAILBOX, PATIENCE, label, shape, stay, tell, until};
use rohrpost_mailbox::{Interest, Receiver, WATCHES_MAX, Waiting, Watches};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Documented in docs/src/shared-memory.md: of a participant, `bell` and `polling`.
const ENTRIES: usize = 64;
const BELL: usize = 8;
const POLLING: usize = 32;

/// A word of the first participant.
fn word(ground: &Ground, at: usize) -> u32 {
    let bytes = std::fs::read(ground.path().join("node")).unwrap();
    u32::from_ne_bytes(bytes[ENTRIES + at..ENTRIES + at + 4].try_into().unwrap())
}

fn pipe(ground: &Ground) -> PathBuf {
    ground.path().join("bell.0")
}

fn take_all(receiver: &mut Receiver) -> u32 {
    std::iter::from_fn(|| receiver.try_receive().map(drop)).count() as u32
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    if role == "send without descriptors" {
        return send_without_descriptors(&ground);
    }
    assert_eq!(role, "sleep in poll");
    let me = ground.join();
    let mut receiver = me.receiver(MAILBOX, shape(4)).unwrap();
    let (_other_end, watched) = UnixStream::pair().unwrap();
    let mut watches = Watches::new(&me).unwrap();
    watches.add(&watched, Interest::Read).unwrap();
    tell("about to sleep");
    watches.wait_any(&mut [&mut receiver], Waiting::default(), || false);
    tell("woken");
    stay();
}

#[test]
fn either_ends_the_sleep_and_is_told_apart() {
    let (ground, me, mut receiver) = Ground::owned(shape(4));
    let mut watches = Watches::new(&me).unwrap();
    let (mut far, mut near) = UnixStream::pair().unwrap();
    let watch = watches.add(&near, Interest::Read).unwrap();
    let deadline = || Waiting::from(PATIENCE);

    far.write_all(b"x").unwrap();
    watches.wait_any(&mut [&mut receiver], deadline(), || false);
    let ready = watches.next_ready().unwrap();
    assert_eq!((ready.watch, ready.readable, ready.writable), (watch, true, false));
    assert_eq!(watches.next_ready(), None, "each is told once");
    near.read_exact(&mut [0]).unwrap();
    watches.look();
    assert_eq!(watches.next_ready(), None);

    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    watches.wait_any(&mut [&mut receiver], deadline(), || false);
    assert_eq!((take_all(&mut receiver), watches.next_ready()), (1, None));

    let room = watches.add(&near, Interest::Write).unwrap();
    watches.wait_any(&mut [&mut receiver], deadline(), || false);
    let ready = watches.next_ready().unwrap();
    assert_eq!((ready.watch, ready.readable, ready.writable), (room, false, true));
    assert!(watches.remove(room) && !watches.remove(room));

    // The end of the other side is something to read.
    drop(far);
    watches.wait_any(&mut [&mut receiver], deadline(), || false);
    assert!(watches.next_ready().unwrap().readable);
    assert!(watches.remove(watch) && watches.is_empty());

    let began = Instant::now();
    let slept = watches.wait_any(&mut [&mut receiver], Duration::from_millis(20), || false);
    assert!(began.elapsed() >= Duration::from_millis(20) && slept > Duration::ZERO, "nothing is watched any more");
}

#[test]
fn a_descriptor_is_seen_also_when_packages_leave_no_time_to_sleep() {
    let (ground, me, mut receiver) = Ground::owned(shape(4));
    let mut watches = Watches::new(&me).unwrap();
    let (mut far, near) = UnixStream::pair().unwrap();
    let watch = watches.add(&near, Interest::Read).unwrap();
    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    far.write_all(b"x").unwrap();
    let slept = watches.wait_any(&mut [&mut receiver], Waiting::default(), || false);
    assert_eq!((slept, watches.next_ready().unwrap().watch), (Duration::ZERO, watch));
}

#[test]
fn a_timeout_is_kept_in_poll_to_less_than_a_millisecond() {
    let (_ground, me, mut receiver) = Ground::owned(shape(4));
    let mut watches = Watches::new(&me).unwrap();
    let (_far, near) = UnixStream::pair().unwrap();
    watches.add(&near, Interest::Read).unwrap();
    for timeout in [300, 1_700].map(Duration::from_micros) {
        // However busy the computer is, one of many is not kept waiting by others.
        until("a timeout is kept to the fraction of a millisecond", || {
            let began = Instant::now();
            watches.wait_any(&mut [&mut receiver], timeout, || false);
            assert!(began.elapsed() >= timeout);
            began.elapsed() < timeout + Duration::from_micros(600)
        });
    }
}

/// Without a deadline: a receiver that loses a wake-up hangs.
#[test]
fn no_wake_up_is_lost_between_many_ringers_and_a_poller() {
    const ROUNDS: u32 = 3_000;
    let (ground, me, mut receiver) = Ground::owned(shape(8));
    let (mut far, mut near) = UnixStream::pair().unwrap();
    near.set_nonblocking(true).unwrap();
    let (received, read) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)));
    let poller = std::thread::spawn({
        let (received, read) = (received.clone(), read.clone());
        move || {
            let mut watches = Watches::new(&me).unwrap();
            watches.add(&near, Interest::Read).unwrap();
            while received.load(Ordering::Relaxed) < 2 * ROUNDS || read.load(Ordering::Relaxed) < ROUNDS {
                watches.wait_any(&mut [&mut receiver], Waiting::default(), || false);
                received.fetch_add(take_all(&mut receiver), Ordering::AcqRel);
                while watches.next_ready().is_some() {
                    read.fetch_add(near.read(&mut [0; 16]).unwrap_or(0) as u32, Ordering::AcqRel);
                }
            }
        }
    });
    // Each sends its next only when the last has come, so that the poller sleeps before every one.
    let patient = |count: &AtomicU32, wanted: u32| {
        let began = Instant::now();
        while count.load(Ordering::Acquire) < wanted {
            assert!(began.elapsed() < PATIENCE, "a wake-up was lost");
            std::thread::yield_now();
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..2 {
            let mut sender = ground.sender();
            let received = &received;
            scope.spawn(move || {
                for _ in 0..ROUNDS {
                    let before = received.load(Ordering::Acquire);
                    sender.send(&label(LOW, 0), &[]).unwrap();
                    patient(received, before + 1);
                }
            });
        }
        for round in 0..ROUNDS {
            far.write_all(b"x").unwrap();
            patient(&read, round + 1);
        }
    });
    poller.join().unwrap();
}

#[test]
fn a_death_in_poll_does_no_harm() {
    let (ground, node) = Ground::made();
    let sleeper = ground.start("sleep in poll");
    assert_eq!(sleeper.hear(), "about to sleep");
    until("it polls", || word(&ground, POLLING) == 1);
    assert!(pipe(&ground).exists());
    sleeper.kill();
    let mut sender = ground.sender();
    for id in 0..3 {
        sender.send(&label(LOW, id), &[]).unwrap();
    }
    node.announce_death();
    assert_eq!(word(&ground, POLLING), 0, "the sender joined in the dead one's place");
    assert!(!pipe(&ground).exists());
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    assert_eq!(take_all(&mut receiver), 3);
}

#[test]
fn a_ringer_meets_a_dead_poller_and_goes_on() {
    let ground = Ground::new();
    let first = ground.join();
    let sleeper = ground.start("sleep in poll");
    assert_eq!(sleeper.hear(), "about to sleep");
    let mut sender = first.sender(MAILBOX).unwrap();
    let asleep = || std::fs::read(ground.path().join("node")).unwrap()[ENTRIES + 64 + POLLING] == 1;
    until("it polls", asleep);
    sleeper.kill();
    // Nobody has taken its place: it still seems to sleep, in a pipe that nobody reads.
    assert!(asleep());
    for id in 0..4 {
        sender.send(&label(LOW, id), &[]).unwrap();
    }
    assert!(asleep());
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    assert_eq!(take_all(&mut receiver), 4);
}

#[test]
fn a_living_poller_of_another_process_is_woken() {
    let ground = Ground::new();
    let sleeper = ground.start("sleep in poll");
    assert_eq!(sleeper.hear(), "about to sleep");
    until("it polls", || word(&ground, POLLING) == 1);
    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    assert_eq!(sleeper.hear(), "woken");
    assert_eq!(word(&ground, POLLING), 0);
    sleeper.kill();
}

/// As a process that has used up what it may open.
fn send_without_descriptors(ground: &Ground) {
    let mut sender = ground.sender();
    let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: reads the limit, which outlives the call.
    assert_eq!(unsafe { libc::setrlimit(libc::RLIMIT_NOFILE, &raw const none) }, 0);
    assert!(std::fs::File::open("/dev/null").is_err());
    sender.send(&label(LOW, 1), &[]).unwrap();
    tell("sent");
    stay();
}

#[test]
fn a_ringer_that_cannot_open_the_pipe_wakes_the_poller() {
    let (ground, me, mut receiver) = Ground::owned(shape(4));
    let (_far, near) = UnixStream::pair().unwrap();
    let mut watches = Watches::new(&me).unwrap();
    watches.add(&near, Interest::Read).unwrap();
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        // No deadline, and no reason but the package.
        watches.wait_any(&mut [&mut receiver], Waiting::default(), || false);
        let _ = tell.send(take_all(&mut receiver));
    });
    until("it polls", || word(&ground, POLLING) == 1);
    let sender = ground.start("send without descriptors");
    assert_eq!(sender.hear(), "sent");
    assert_eq!(told.recv_timeout(PATIENCE), Ok(1));
    sender.kill();
}

#[test]
fn a_poller_naps_on_while_nobody_rings() {
    let (_ground, me, mut receiver) = Ground::owned(shape(4));
    let (_far, near) = UnixStream::pair().unwrap();
    let mut watches = Watches::new(&me).unwrap();
    watches.add(&near, Interest::Read).unwrap();
    // Longer than it trusts the pipe.
    let (began, timeout) = (Instant::now(), Duration::from_millis(350));
    let slept = watches.wait_any(&mut [&mut receiver], timeout, || false);
    assert!(began.elapsed() >= timeout && slept >= timeout - Duration::from_millis(100), "{slept:?}");
}

#[test]
fn the_pipe_is_there_as_long_as_somebody_watches() {
    let (ground, me) = Ground::joined();
    assert!(!pipe(&ground).exists());
    let watches = Watches::new(&me).unwrap();
    assert!(pipe(&ground).exists());
    let again = Watches::new(&me).err().unwrap();
    assert_eq!(again.kind(), ErrorKind::AlreadyExists);
    drop(watches);
    assert!(!pipe(&ground).exists());
    let _watches = Watches::new(&me).unwrap();
    me.leave();
    assert!(!pipe(&ground).exists(), "also for processes with threads that keep all this until they end");
}

#[test]
fn there_is_room_for_so_many_and_no_more() {
    let (_ground, me) = Ground::joined();
    let mut watches = Watches::new(&me).unwrap();
    let (_far, near) = UnixStream::pair().unwrap();
    let all: Vec<_> = (0..WATCHES_MAX).map(|_| watches.add(&near, Interest::Both).unwrap()).collect();
    let error = watches.add(&near, Interest::Both).unwrap_err();
    assert_eq!(error.to_string(), format!("{WATCHES_MAX} descriptors are watched already; remove one first"));
    watches.look();
    let told: Vec<_> = std::iter::from_fn(|| watches.next_ready()).map(|ready| ready.watch).collect();
    assert_eq!(told, all);
    assert!(all.into_iter().all(|watch| watches.remove(watch)));
}

#[test]
fn a_sender_rings_no_receiver_that_spins() {
    let (ground, _me, mut receiver) = Ground::owned(shape(4));
    let mut sender = ground.sender();
    let looks = Arc::new(AtomicU32::new(0));
    let spinner = std::thread::spawn({
        let looks = looks.clone();
        move || {
            let waiting = Waiting { spin: PATIENCE, deadline: None };
            let look = || {
                looks.fetch_add(1, Ordering::Relaxed);
                false
            };
            let slept = rohrpost_mailbox::wait_any(&mut [&mut receiver], waiting, look);
            (slept, take_all(&mut receiver))
        }
    });
    until("it spins", || looks.load(Ordering::Relaxed) > 100);
    let rung = word(&ground, BELL);
    sender.send(&label(LOW, 1), &[]).unwrap();
    assert_eq!(spinner.join().unwrap(), (Duration::ZERO, 1));
    assert_eq!(word(&ground, BELL), rung, "no ring, so no system call");
}

#[test]
fn a_receiver_that_has_spun_long_enough_sleeps_until_the_deadline() {
    let (ground, _me, mut receiver) = Ground::owned(shape(4));
    let (spin, timeout) = (Duration::from_millis(2), Duration::from_millis(20));
    let waiting = Waiting { spin, ..timeout.into() };
    // A computer that stands still while it spins leaves it nothing to sleep.
    let sleeps = (0..20).any(|_| {
        let began = Instant::now();
        let slept = rohrpost_mailbox::wait_any(&mut [&mut receiver], waiting, || false);
        let took = began.elapsed();
        assert!(took >= timeout && slept <= took - spin, "{slept:?} of {took:?}");
        slept > Duration::ZERO
    });
    assert!(sleeps, "it sleeps when it has spun long enough");
    // A deadline ends the spinning too.
    let began = Instant::now();
    let waiting = Waiting { spin: PATIENCE, ..Duration::from_millis(1).into() };
    assert!(receiver.receive_timeout(waiting).is_none() && began.elapsed() < PATIENCE);
    ground.sender().send(&label(LOW, 1), &[]).unwrap();
    assert!(receiver.receive_timeout(waiting).is_some());
}
