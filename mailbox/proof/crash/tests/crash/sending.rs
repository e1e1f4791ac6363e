//! Deaths of senders.

use crate::aftermath::{all_usable, drain};
use crate::ground::{Death, Ground, HIGH, LATEST, LOW, MAILBOX, OTHER_SHAPE, each_step, nothing, send};
use rohrpost_mailbox_crash::{Interest, Label, Loss, Receiver, Watches};
use std::time::{Duration, Instant};

/// Steps at which the package is accepted, or will be when the word changes: all from `publish: ready` on.
fn accepted(death: Option<&Death>) -> bool {
    death.is_none_or(|death| {
        let after = [
            "publish: ready",
            "publish: hint",
            "publish: alert",
            "send: before bell",
            "send: rung",
            "send: before count",
        ];
        let begins = ["traffic: ", "cell: ", "bell: ", "ring: "];
        after.contains(&death.step.as_str()) || begins.iter().any(|begin| death.step.starts_with(begin))
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

/// The receiver works off less important packages that it knows, and looks at nothing else unless somebody alerts. A
/// sender that dies before it alerts has left a package that is found when the death is noticed, and then it is first.
#[test]
fn a_sender_dies_above_the_level() {
    let scene = |ground: &Ground| {
        let mut receiver = ground.receiver();
        ground.send(LOW, 0..3);
        assert!(receiver.try_receive().is_some());
        receiver
    };
    each_step("send", 4, scene, |ground, mut receiver, death| {
        // That which was received before is in the accounts, and not in what is found.
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        let expected: &[_] =
            if accepted(death) { &[(100, false), (1, false), (2, false)] } else { &[(1, false), (2, false)] };
        assert_eq!(found.packages, expected, "{death:?}");
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

/// What waited is received or counted as replaced, whatever step its sender died at, and never comes after the newer
/// one.
fn a_sender_dies_replacing(others: u32, steps_min: u64) {
    let scene = |ground: &Ground| {
        let receiver = ground.join().receiver(MAILBOX, LATEST).unwrap();
        // Each from a sender of its own, so that none replaces another.
        (0..others).for_each(|id| ground.send(LOW, [id]));
        receiver
    };
    each_step("send the newest", steps_min, scene, |ground, mut receiver, death| {
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.scene(), (0..others).collect::<Vec<u32>>(), "{death:?}");
        assert_eq!(found.times(101), usize::from(accepted(death)), "{death:?}");
        assert!(found.packages.is_sorted(), "{death:?}: {found:?}");
        let (old, replaced) = (found.times(100) as u64, found.lost(Loss::Replaced));
        let expected: &[_] = match death.map(|death| death.step.as_str()) {
            None => &[(0, 1)],
            // It had said that it would, and is believed.
            Some("replace: marked") => &[(1, 1)],
            // Counted by itself, then by the receiver that freed its slot.
            Some("counters: loss" | "publish: ticket") => &[(0, 2)],
            Some(_) => &[(1, 0), (0, 1)],
        };
        assert!(expected.contains(&(old, replaced)), "{death:?}: {old} received, {replaced} replaced");
        all_take_states(ground, receiver);
    });
}

/// Every slot takes a package of a state of its own.
fn all_take_states(ground: &Ground, receiver: Receiver) {
    let mut sender = ground.sender();
    for id in 0..LATEST.slots {
        sender.send(&Label { id, ..Label::default() }, &[]).unwrap();
    }
    drop(sender);
    assert_eq!(receiver.close(), usize::from(LATEST.slots), "every slot can be used");
}

/// What it would replace has been received, which it finds out after it has said that it replaces it.
#[test]
fn a_sender_dies_finding_nothing_to_replace() {
    each_step("send anew what was received", 8, nothing, |ground, (), death| {
        let mut receiver = ground.join().receiver(MAILBOX, LATEST).unwrap();
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!((found.times(100), found.times(101)), (0, usize::from(accepted(death))), "{death:?}");
        // It had said that it would, and is believed.
        let believed = death.is_some_and(|death| death.step == "replace: marked");
        assert_eq!(found.lost(Loss::Replaced), u64::from(believed), "{death:?}");
        all_take_states(ground, receiver);
    });
}

#[test]
fn a_sender_dies_replacing_beside_a_free_slot() {
    a_sender_dies_replacing(1, 8);
}

#[test]
fn a_sender_dies_replacing_in_a_full_mailbox() {
    a_sender_dies_replacing(3, 10);
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
        let counted = |death: &Death| {
            death.step == "counters: loss" || ["traffic: ", "cell: "].iter().any(|begin| death.step.starts_with(begin))
        };
        let counted = death.is_none_or(counted);
        assert_eq!(found.lost(Loss::Refused), u64::from(counted), "{death:?}");
        all_usable(ground, receiver);
    });
}

#[test]
fn a_sender_dies_beside_a_sleeping_receiver() {
    a_sender_dies_beside_a_sleeper(6, |receiver| receiver.receive_timeout(PATIENCE).map(|package| package.body()[0]));
}

#[test]
fn a_sender_dies_beside_a_receiver_that_sleeps_in_poll() {
    a_sender_dies_beside_a_sleeper(9, |receiver| {
        let (_far, near) = std::os::unix::net::UnixStream::pair().unwrap();
        let mut watches = Watches::new(receiver.participant()).unwrap();
        watches.add(&near, Interest::Read).unwrap();
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            if let Some(package) = receiver.try_receive() {
                return Some(package.body()[0]);
            }
            watches.wait_any(&mut [receiver], Some(end), || false);
        }
        None
    });
}

/// How long a receiver sleeps.
const PATIENCE: Duration = Duration::from_secs(30);

fn a_sender_dies_beside_a_sleeper(steps_min: u64, receive: fn(&mut Receiver) -> Option<u8>) {
    let scene = |ground: &Ground| {
        let mut receiver = ground.receiver();
        let (tell, told) = std::sync::mpsc::channel();
        let sleeper = std::thread::spawn(move || {
            tell.send(nix::unistd::gettid()).unwrap();
            let start = Instant::now();
            // What is there when the sleep ends by itself has woken nobody.
            let woken = receive(&mut receiver).filter(|_| start.elapsed() < PATIENCE);
            (receiver, woken)
        });
        until_asleep(told.recv().unwrap());
        sleeper
    };
    each_step("send", steps_min, scene, |ground, sleeper, death| {
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
        each_step(role, steps_min, nothing, |ground, (), death| {
            let mut receiver: Receiver = ground.join().receiver(MAILBOX, OTHER_SHAPE).unwrap();
            let found = drain(ground, &mut receiver, u64::from(death.is_some()));
            // In the retired mailbox the same steps are passed first, so their names do not say which was the last.
            assert!(found.times(100) <= 1, "{death:?}");
            assert!(death.is_some() || found.times(100) == 1);
            all_usable(ground, receiver);
        });
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
