//! Deaths of receivers.

use crate::aftermath::{adopt_and_drain, all_usable, drain, empty, received};
use crate::ground::{Ground, HIGH, LOW, MAILBOX, OTHER_SHAPE, SHAPE, each_step, nothing};
use rohrpost_mailbox_crash::{Loss, Shape};
use std::cell::Cell;
use std::time::Duration;

#[test]
fn a_receiver_dies_receiving() {
    each_step("receive", 3, Ground::orphan, |ground, (), death| {
        let found = adopt_and_drain(ground, u64::from(death.is_some()));
        let expected: &[_] = match death.map(|death| death.step.as_str()) {
            // Not taken yet.
            Some("level: lowered" | "take: chosen") => &[(0, false), (1, false), (2, false)],
            // In hand.
            Some("take: taken" | "release: before") => &[(0, true), (1, false), (2, false)],
            _ => &[(1, false), (2, false)],
        };
        assert_eq!(found.packages, expected, "{death:?}");
    });
}

#[test]
fn a_receiver_dies_going_to_sleep() {
    each_step(
        "receive nothing",
        1,
        |ground| drop(ground.receiver()),
        |ground, (), death| {
            // Rings a bell that nobody hears.
            ground.send(HIGH, [100]);
            let found = adopt_and_drain(ground, u64::from(death.is_some()));
            assert_eq!(found.packages, [(100, false)]);
        },
    );
}

#[test]
fn a_receiver_dies_asleep_in_poll() {
    each_step(
        "sleep in poll",
        2,
        |ground| drop(ground.receiver()),
        |ground, (), death| {
            // Rings a bell that nobody hears, and writes into a pipe that nobody reads.
            let mut first = ground.join().sender(MAILBOX).unwrap();
            crate::ground::send(&mut first, HIGH, 100).unwrap();
            drop(first);
            let found = adopt_and_drain(ground, u64::from(death.is_some()));
            assert_eq!(found.packages, [(100, false)]);
        },
    );
}

#[test]
fn a_receiver_dies_dropping_stale_packages() {
    each_step("receive stale", 9, nothing, |ground, (), death| {
        let shape = Shape { max_age: Some(Duration::from_nanos(1)), ..SHAPE };
        let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert!(found.packages.is_empty());
        assert!((3..=4).contains(&found.lost(Loss::Stale)), "{death:?}");
        assert_eq!(receiver.close(), 0);
        empty(ground);
    });
}

#[test]
fn an_owner_that_fixes_what_a_death_left_dies_too() {
    for first in ["send", "displace", "receive", "adopt", "close"] {
        for fatal in 1.. {
            let first_survived = Cell::new(false);
            // The second in turn; its last turn survives.
            each_step(
                "adopt",
                1,
                |ground| {
                    ground.orphan();
                    ground.send(LOW, [3]);
                    ground.run(first, fatal).is_none()
                },
                |ground, survived, death| {
                    first_survived.set(survived);
                    let deaths = u64::from(!survived) + u64::from(death.is_some());
                    let found = adopt_and_drain(ground, deaths);
                    assert!((0..4).all(|id| found.times(id) <= 1), "{first}, step {fatal}, then {death:?}: {found:?}");
                },
            );
            if first_survived.get() {
                break;
            }
        }
    }
}

/// Package 0 is in a dead receiver's hand, 1 and 2 are ready, and a dead sender was filling the last slot.
fn ready_taken_and_filling(ground: &Ground) {
    ground.orphan();
    assert!(ground.run("die with a package", u64::MAX).is_some());
    assert!(ground.run("die displacing", u64::MAX).is_some());
}

#[test]
fn a_receiver_dies_adopting() {
    each_step("adopt", 5, ready_taken_and_filling, |ground, (), death| {
        // A sender that died unpublished took no ticket; so of the dead only receivers put the accounts out.
        let found = adopt_and_drain(ground, 2);
        assert_eq!(found.packages, [(0, true), (1, false), (2, false)], "{death:?}");
        // Freed and counted by the victim or by us.
        let unfinished = found.lost(Loss::Unfinished);
        assert!(unfinished == 1 || death.is_some_and(|death| death.step == "reclaim: freed") && unfinished == 0);
    });
}

#[test]
fn a_receiver_dies_adopting_what_killed_the_last_two() {
    let scene = |ground: &Ground| {
        ready_taken_and_filling(ground);
        assert!(ground.run("die with a package", u64::MAX).is_some());
    };
    each_step("adopt", 5, scene, |ground, (), death| {
        let found = adopt_and_drain(ground, 3);
        assert_eq!(found.packages, [(1, false), (2, false)], "{death:?}");
        // Counted before it is dropped: at worst once too often, never not at all.
        let poison = found.lost(Loss::Poison);
        assert!(poison == 1 || death.is_some() && poison == 2, "{death:?}: {poison} counted as poison");
    });
}

#[test]
fn a_receiver_dies_searching_after_a_sender_died() {
    let scene = |ground: &Ground| {
        drop(ground.receiver());
        ground.send(LOW, 0..4);
    };
    each_step("search after a death", 6, scene, |ground, (), death| {
        let found = adopt_and_drain(ground, 2);
        let (kept, lost) = (found.scene().len() as u64, found.lost(Loss::Displaced));
        // Package 3 was displaced, package 0 is received by the victim or by us.
        assert!(kept == 3 || kept == 2 && received(&found.info) >= 3, "{death:?}: {found:?}");
        assert!(lost == 1 || death.is_some() && lost == 2, "{death:?}: {lost}");
    });
}

#[test]
fn a_receiver_dies_replacing_a_mailbox_of_another_shape() {
    each_step("replace", 8, ready_taken_and_filling, |ground, (), death| {
        let mut receiver = ground.join().receiver(MAILBOX, OTHER_SHAPE).unwrap();
        let found = drain(ground, &mut receiver, 2);
        assert!(found.packages.is_empty(), "given up with the old mailbox, {death:?}");
        // Package 0 was in a dead one's hand already: if it dies again in the victim's, it is poison.
        let lost = found.lost(Loss::Closed) + found.lost(Loss::Poison);
        assert!(lost == 3 || death.is_some() && lost == 4, "{death:?}: {lost} counted as lost");
        all_usable(ground, receiver);
    });
}

#[test]
fn a_receiver_dies_replacing_a_mailbox_that_a_living_sender_fills() {
    let scene = |ground: &Ground| {
        drop(ground.receiver());
        ground.send(LOW, 0..4);
        // Displaces package 3, and outlives the scene.
        Box::leak(Box::new(ground.sender())).loan(HIGH).unwrap()
    };
    each_step("replace", 8, scene, |ground, mut loan, death| {
        let mut receiver = ground.join().receiver(MAILBOX, OTHER_SHAPE).unwrap();
        let label = crate::victim::write(&mut loan, 100);
        loan.send(&label, 8).unwrap();
        let found = drain(ground, &mut receiver, u64::from(death.is_some()));
        assert_eq!(found.packages, [(100, false)], "{death:?}: it moved on");
        for (cause, packages) in [(Loss::Displaced, 1), (Loss::Closed, 3)] {
            let lost = found.lost(cause);
            assert!(lost == packages || death.is_some() && lost == packages + 1, "{death:?}: {cause:?} {lost}");
        }
    });
}
