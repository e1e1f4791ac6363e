//! Processes killed with a package or a loan in hand.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, PATIENCE, accounted, label, lost, received, shape, stay, tell, until};
use rohrpost_mailbox::{Loss, Options, SendError, Shape};
use std::time::Duration;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    match role.as_str() {
        "take one" => {
            let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
            let package = receiver.receive();
            tell(format_args!("{} {}", package.head().id, package.head().options.has(Options::REDELIVERED)));
            stay();
        }
        "lend" => {
            let mut sender = ground.sender();
            let _loan = sender.loan(HIGH).unwrap();
            tell("lent");
            stay();
        }
        other => panic!("no role {other}"),
    }
}

#[test]
fn what_kills_its_receiver_twice_is_poison() {
    let ground = Ground::new();
    drop(ground.join().receiver(MAILBOX, shape(4)).unwrap());
    let mut sender = ground.sender();
    sender.send(&label(HIGH, 1), &[b"deadly"]).unwrap();
    sender.send(&label(LOW, 2), &[b"harmless"]).unwrap();
    for heard in ["1 false", "1 true"] {
        let receiver = ground.start("take one");
        assert_eq!(receiver.hear(), heard);
        receiver.kill();
    }
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let package = receiver.try_receive().unwrap();
    assert_eq!((package.body(), package.head().options), (&b"harmless"[..], Options(0)));
    drop(package);
    assert!(receiver.try_receive().is_none());
    let info = ground.look();
    assert_eq!((lost(&info, Loss::Poison), info.adoptions, info.depth), (1, 3, 0));
    // It was received twice before it was lost: once too often for each death.
    assert_eq!((info.sent, received(&info), accounted(&info)), (2, 3, 4));
}

#[test]
fn a_package_outlives_its_receiver_once() {
    let ground = Ground::new();
    let first = {
        let process = ground.start("take one");
        until("it receives", || ground.node().look_at(MAILBOX).is_some_and(|info| info.owner.is_some()));
        process
    };
    let mut sender = ground.sender();
    for id in 1..4 {
        sender.send(&label(LOW, id), &[&[id as u8]]).unwrap();
    }
    assert_eq!(first.hear(), "1 false");
    first.kill();
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    for (id, redelivered) in [(1, true), (2, false), (3, false)] {
        let package = receiver.try_receive().unwrap();
        assert_eq!((package.head().id, package.body()), (id, &[id as u8][..]), "in order all the same");
        assert_eq!(package.head().options.has(Options::REDELIVERED), redelivered);
    }
}

#[test]
fn a_dead_sender_s_slot_comes_back_and_the_sleeping_receiver_sees_to_it() {
    let (ground, mut receiver, mut sender) = Ground::ends(shape(1));
    sender.send(&label(LOW, 1), &[]).unwrap();
    let dead = ground.start("lend");
    assert_eq!(dead.hear(), "lent");
    dead.kill();
    let sleeper = std::thread::spawn(move || {
        let id = receiver.receive_timeout(PATIENCE).map(|package| package.head().id);
        (receiver, id)
    });
    assert!(matches!(sender.send(&label(HIGH, 2), &[]), Err(SendError::Full(_))), "nobody has said that it died");
    ground.node().announce_death();
    until("the slot is free", || sender.send(&label(HIGH, 3), &[]).is_ok());
    let (_receiver, id) = sleeper.join().unwrap();
    assert_eq!(id, Some(3));
    let info = ground.look();
    assert_eq!(
        (lost(&info, Loss::Unfinished), lost(&info, Loss::Displaced)),
        (1, 1),
        "what it had displaced is counted"
    );
    assert_eq!(info.sent, accounted(&info));
}

#[test]
fn the_successor_of_a_dead_participant_announces_its_death() {
    let (ground, _me, mut receiver) = Ground::owned(shape(1));
    let dead = ground.start("lend");
    assert_eq!(dead.hear(), "lent");
    dead.kill();
    assert!(receiver.try_receive().is_none());
    let mut sender = ground.sender();
    assert!(receiver.try_receive().is_none(), "looks for what was left");
    sender.send(&label(LOW, 1), &[]).unwrap();
    assert_eq!(lost(&ground.look(), Loss::Unfinished), 1);
}

#[test]
fn what_waited_too_long_is_not_received() {
    let ground = Ground::new();
    let young = Shape { max_age: Some(Duration::from_secs(3600)), ..shape(8) };
    let old = Shape { max_age: Some(Duration::from_nanos(1)), ..shape(8) };
    for (shape, fresh) in [(young, true), (old, false)] {
        let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
        let mut sender = ground.sender();
        (0..3).for_each(|id| sender.send(&label(LOW, id), &[]).unwrap());
        assert_eq!(std::iter::from_fn(|| receiver.try_receive().map(drop)).count(), if fresh { 3 } else { 0 });
        let info = ground.look();
        assert_eq!((lost(&info, Loss::Stale), info.depth), (if fresh { 0 } else { 3 }, 0));
        assert_eq!(info.sent, accounted(&info));
    }
}

#[test]
fn an_age_without_end_keeps_what_waits_for_the_next_receiver() {
    let ground = Ground::new();
    for age in [Duration::MAX, Duration::from_secs(60)] {
        let shape = Shape { max_age: Some(age), ..shape(4) };
        drop(ground.join().receiver(MAILBOX, shape).unwrap());
        ground.sender().send(&label(LOW, 1), &[]).unwrap();
        let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
        assert!(receiver.try_receive().is_some(), "{age:?} is the same shape both times");
    }
}
