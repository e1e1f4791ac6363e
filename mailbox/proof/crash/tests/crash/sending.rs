//! Deaths of senders.

use crate::aftermath::{all_usable, drain};
use crate::ground::{Death, Ground, HIGH, LOW, MAILBOX, OTHER_SHAPE, each_step, send};
use rohrpost_mailbox_crash::{Loss, Receiver};
use std::time::{Duration, Instant};

/// Steps at which the package is accepted, or will be when the word changes: all from `publish: ready` on.
fn accepted(death: Option<&Death>) -> bool {
    death.is_none_or(|death| {
        let after = ["publish: ready", "publish: hint", "send: before bell", "send: rung", "send: before count"];
        after.contains(&death.step.as_str()) || death.step.starts_with("traffic: ")
    })
}

#[test]
fn a_sender_dies_sending() {
    each_step("send", 4, Ground::receiver, |ground, mut receiver, death| {
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.times(100), usize::from(accepted(death)), "{death:?}");
        all_usable(ground, receiver);
    });
}

#[test]
fn a_sender_dies_displacing() {
    let scene = |ground: &Ground| {
        let receiver = ground.receiver();
        ground.send(LOW, 0..4);
        receiver
    };
    each_step("displace", 6, scene, |ground, mut receiver, death| {
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.times(100), usize::from(accepted(death)), "{death:?}");
        let (kept, lost) = (found.scene(), found.lost(Loss::Displaced));
        assert!([0, 1, 2, 3].starts_with(&kept) && kept.len() >= 3, "{death:?} {found:?}");
        assert!((4..=5).contains(&(kept.len() as u64 + lost)), "{death:?}: no loss is hidden: {found:?}");
        all_usable(ground, receiver);
    });
}

#[test]
fn a_sender_dies_being_refused() {
    let scene = |ground: &Ground| {
        let receiver = ground.receiver();
        ground.send(LOW, 0..4);
        receiver
    };
    each_step("be refused", 5, scene, |ground, mut receiver, death| {
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.scene(), [0, 1, 2, 3], "{death:?}");
        assert_eq!(found.times(100), 0, "{death:?}");
        // In the mailbox's counters first, then in its own.
        let counted = |death: &Death| death.step == "counters: loss" || death.step.starts_with("traffic: ");
        let counted = death.is_none_or(counted);
        assert_eq!(found.lost(Loss::Refused), u64::from(counted), "{death:?}");
        all_usable(ground, receiver);
    });
}

#[test]
fn a_sender_dies_beside_a_sleeping_receiver() {
    let scene = |ground: &Ground| {
        let mut receiver = ground.receiver();
        let (tell, told) = std::sync::mpsc::channel();
        let sleeper = std::thread::spawn(move || {
            tell.send(nix::unistd::gettid()).unwrap();
            let woken = receiver.receive_timeout(Duration::from_secs(30)).map(|package| package.body()[0]);
            (receiver, woken)
        });
        until_asleep(told.recv().unwrap());
        sleeper
    };
    each_step("send", 6, scene, |ground, sleeper, death| {
        ground.node().announce_death();
        if !accepted(death) {
            ground.send(HIGH, [101]);
        }
        let (mut receiver, woken) = sleeper.join().unwrap();
        assert_eq!(woken, Some(if accepted(death) { 100 } else { 101 }), "{death:?}");
        drain(ground, &mut receiver, u64::from(death.is_some()));
        all_usable(ground, receiver);
    });
}

/// A thread that has nothing to wait for but its mailbox sleeps in it.
fn until_asleep(thread: nix::unistd::Pid) {
    let start = Instant::now();
    let asleep = || {
        let stat = std::fs::read_to_string(format!("/proc/self/task/{thread}/stat")).unwrap();
        stat.rsplit(')').next().unwrap().trim_start().starts_with('S')
    };
    while !asleep() {
        assert!(start.elapsed() < Duration::from_secs(30));
        std::thread::yield_now();
    }
}

#[test]
fn a_sender_dies_dropping_a_loan() {
    each_step("drop a loan", 4, Ground::receiver, |ground, mut receiver, death| {
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert!(found.packages.is_empty());
        all_usable(ground, receiver);
    });
}

#[test]
fn a_sender_dies_moving_on_from_a_retired_mailbox() {
    for (role, steps_min) in [("send into a retired mailbox", 4), ("publish into a retired mailbox", 8)] {
        each_step(
            role,
            steps_min,
            |_| (),
            |ground, (), death| {
                let mut receiver: Receiver = ground.join().receiver(MAILBOX, OTHER_SHAPE).unwrap();
                let found = drain(ground, &mut receiver, u64::from(death.is_some()));
                // In the retired mailbox the same steps are passed first, so their names do not say which was the last.
                assert!(found.times(100) <= 1, "{death:?}");
                assert!(death.is_some() || found.times(100) == 1);
                all_usable(ground, receiver);
            },
        );
    }
}

#[test]
fn a_mailbox_without_receiver_keeps_what_a_dying_sender_had_sent() {
    let scene = |ground: &Ground| ground.orphan();
    each_step("send", 4, scene, |ground, (), death| {
        let mut receiver = ground.receiver();
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.scene(), [0, 1, 2]);
        assert_eq!(found.times(100), usize::from(accepted(death)), "{death:?}");
        let mut sender = ground.sender();
        send(&mut sender, LOW, 5).unwrap();
        drop(sender);
        drain(ground, &mut receiver, u64::from(death.is_some()));
        all_usable(ground, receiver);
    });
}
