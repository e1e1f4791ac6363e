//! Deaths of those who make and remove nodes, participants and mailboxes.

use crate::aftermath::{adopt_and_drain, empty};
use crate::ground::{Ground, LOW, MAILBOX, each_step, send};
use rohrpost_mailbox_crash::{SendError, Watches};

#[test]
fn a_maker_of_a_node_dies() {
    each_step(
        "create node",
        1,
        |_| (),
        |ground, (), _| {
            ground.join();
            drop(ground.receiver());
            adopt_and_drain(ground, 0);
        },
    );
}

#[test]
fn a_joiner_dies() {
    each_step(
        "join",
        3,
        |_| (),
        |ground, (), _| {
            let participant = ground.join();
            assert_eq!(ground.node().participants().len(), 1);
            assert_eq!(ground.node().participants()[0].incarnation, participant.incarnation());
            drop(participant);
            empty(ground);
        },
    );
}

#[test]
fn who_begins_to_watch_dies() {
    each_step(
        "watch",
        1,
        |_| (),
        |ground, (), _| {
            let participant = ground.join();
            assert_eq!(ground.node().participants().len(), 1);
            drop(Watches::new(&participant).unwrap());
            drop(participant);
            let there = std::fs::read_dir(ground.path()).unwrap().count();
            assert_eq!(there, 1, "no pipe stays");
            empty(ground);
        },
    );
}

#[test]
fn a_maker_of_a_mailbox_dies() {
    each_step(
        "create",
        5,
        |_| (),
        |ground, (), _| {
            let found = adopt_and_drain(ground, 0);
            assert!(found.packages.is_empty());
        },
    );
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
fn who_cleans_up_dies() {
    each_step("clean up", 5, Ground::orphan, |ground, (), death| {
        assert!(death.is_some() || !ground.path().exists());
        let found = adopt_and_drain(ground, u64::from(death.is_some()));
        assert!(found.packages.is_empty(), "{death:?} {found:?}");
    });
}
