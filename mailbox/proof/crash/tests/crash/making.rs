//! Deaths of processes that make and remove nodes, participants and mailboxes.

use crate::aftermath::{adopt_and_drain, empty};
use crate::ground::{Ground, LOW, MAILBOX, each_step, nothing, send};
use rohrpost_mailbox_crash::{SendError, Watches};

#[test]
fn a_maker_of_a_node_dies() {
    each_step("create node", 1, nothing, |ground, (), _| {
        ground.join();
        drop(ground.receiver());
        adopt_and_drain(ground, 0);
    });
}

#[test]
fn a_joiner_dies() {
    each_step("join", 6, nothing, |ground, (), _| {
        let participant = ground.join();
        assert_eq!(ground.node().participants().len(), 1);
        assert_eq!(ground.node().participants()[0].incarnation, participant.incarnation());
        // Whatever table the dead one left, this is a new one and whole.
        assert!(ground.node().traffic().is_empty());
        let receiver = ground.receiver();
        ground.send(LOW, 0..1);
        let mut sender = participant.sender(MAILBOX).unwrap();
        send(&mut sender, LOW, 1).unwrap();
        assert_eq!(ground.node().traffic().iter().map(|flow| flow.packages).sum::<u64>(), 1);
        drop((sender, participant));
        receiver.close();
        empty(ground);
    });
}

#[test]
fn a_participant_that_begins_to_watch_dies() {
    each_step("watch", 1, nothing, |ground, (), _| {
        let participant = ground.join();
        assert_eq!(ground.node().participants().len(), 1);
        drop(Watches::new(&participant).unwrap());
        drop(participant);
        let there = std::fs::read_dir(ground.path()).unwrap().count();
        assert_eq!(there, 1, "no pipe stays");
        empty(ground);
    });
}

#[test]
fn a_maker_of_a_mailbox_dies() {
    each_step("create", 5, nothing, |ground, (), _| {
        let found = adopt_and_drain(ground, 0);
        assert!(found.packages.is_empty());
    });
}

#[test]
fn a_receiver_dies_saying_what_its_mailbox_is_for() {
    each_step("say what it is for", 1, nothing, |ground, (), death| {
        let said = ground.node().about(MAILBOX).unwrap();
        assert_eq!(said, if death.is_some() { b"old" } else { b"new" });
        let receiver = ground.receiver();
        receiver.set_about(b"newest").unwrap();
        assert_eq!(ground.node().about(MAILBOX).unwrap(), b"newest");
        receiver.close();
        empty(ground);
    });
}

#[test]
fn a_receiver_dies_closing() {
    let scene = |ground: &Ground| {
        ground.orphan();
        ground.sender()
    };
    each_step("close", 5, scene, |ground, mut sender, death| {
        match send(&mut sender, LOW, 100) {
            Ok(()) => assert!(death.is_none_or(|death| death.step == "adopt: before"), "{death:?}"),
            Err(error) => assert!(matches!(error, SendError::NoMailbox(MAILBOX)), "{error}"),
        }
        drop(sender);
        let found = adopt_and_drain(ground, u64::from(death.is_some()));
        // Retired or gone: nothing of the old mailbox comes back.
        assert!(found.packages.is_empty(), "{death:?} {found:?}");
    });
}

#[test]
fn a_remover_of_an_orphan_dies() {
    each_step("remove an orphan", 5, Ground::orphan, |ground, (), death| {
        let found = adopt_and_drain(ground, u64::from(death.is_some()));
        assert!(found.packages.is_empty(), "{death:?} {found:?}");
    });
}

#[test]
fn a_process_that_cleans_up_dies() {
    each_step("clean up", 5, Ground::orphan, |ground, (), death| {
        assert!(death.is_some() || !ground.path().exists());
        let found = adopt_and_drain(ground, u64::from(death.is_some()));
        assert!(found.packages.is_empty(), "{death:?} {found:?}");
    });
}
