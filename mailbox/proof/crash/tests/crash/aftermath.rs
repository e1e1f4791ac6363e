//! What must hold after any death.

use crate::ground::{Ground, HIGH, LOW, MAILBOX, SHAPE, send};
use rohrpost_mailbox_crash::{Loss, MailboxInfo, Node, Options, Receiver, SendError};
use std::time::Duration;

/// What a mailbox still held, in the order it came.
#[derive(Debug)]
pub(crate) struct Found {
    /// Number, and whether it was handed out a second time.
    pub(crate) packages: Vec<(u32, bool)>,
    pub(crate) info: MailboxInfo,
}

impl Found {
    pub(crate) fn times(&self, id: u32) -> usize {
        self.packages.iter().filter(|package| package.0 == id).count()
    }

    /// Numbers of those below 100, which the scenes sent.
    pub(crate) fn scene(&self) -> Vec<u32> {
        self.packages.iter().map(|package| package.0).filter(|id| *id < 100).collect()
    }

    pub(crate) fn lost(&self, cause: Loss) -> u64 {
        self.info.classes.iter().map(|class| class.lost(cause)).sum()
    }
}

/// Receives all that is there and checks the accounts: off by one at most for each of `deaths`.
pub(crate) fn drain(ground: &Ground, receiver: &mut Receiver, deaths: u64) -> Found {
    let node = ground.node();
    node.announce_death();
    let mut packages = Vec::new();
    while let Some(package) = receiver.try_receive() {
        let number = |at| u32::from_le_bytes(package.body()[at..at + 4].try_into().unwrap());
        assert_eq!(number(0), !number(4), "torn");
        packages.push((number(0), package.head().options.has(Options::REDELIVERED)));
    }
    let info = node.look_at(MAILBOX).unwrap();
    assert_eq!(info.depth, 0);
    let found = Found { packages, info };
    let accounted = received(&found.info) + accepted_losses(&found.info);
    assert!(found.info.sent.abs_diff(accounted) <= deaths, "{deaths} deaths, {accounted} accounted for: {found:#?}");
    found
}

pub(crate) fn received(info: &MailboxInfo) -> u64 {
    info.classes.iter().map(|class| class.received).sum()
}

pub(crate) fn accepted_losses(info: &MailboxInfo) -> u64 {
    let accepted = Loss::ALL.into_iter().filter(|cause| cause.was_accepted());
    accepted.map(|cause| info.classes.iter().map(|class| class.lost(cause)).sum::<u64>()).sum()
}

/// Every slot can be used, the mailbox can be closed, and the node can be removed.
pub(crate) fn all_usable(ground: &Ground, mut receiver: Receiver) {
    let info = ground.node().look_at(MAILBOX).unwrap();
    let ids = 1000..1000 + u32::from(info.shape.slots);
    let mut sender = ground.sender();
    for id in ids.clone() {
        send(&mut sender, LOW, id).unwrap();
    }
    assert!(matches!(send(&mut sender, LOW, 1), Err(SendError::Full(MAILBOX))));
    for id in ids {
        let package = receiver.receive_timeout(Duration::from_secs(20)).unwrap();
        assert_eq!(package.body()[..4], id.to_le_bytes());
    }
    send(&mut sender, HIGH, 1).unwrap();
    drop(sender);
    assert_eq!(receiver.close(), 1);
    empty(ground);
}

/// Nothing lives or stays here.
pub(crate) fn empty(ground: &Ground) {
    let node = Node::open(ground.path()).unwrap();
    assert!(node.participants().is_empty());
    assert!(node.remove_if_dead().unwrap());
    assert!(!ground.path().exists());
}

/// Adopts the mailbox, then all of the above.
pub(crate) fn adopt_and_drain(ground: &Ground, deaths: u64) -> Found {
    let mut receiver = ground.join().receiver(MAILBOX, SHAPE).unwrap();
    let found = drain(ground, &mut receiver, deaths);
    all_usable(ground, receiver);
    found
}
