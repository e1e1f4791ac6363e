//! What must hold after any death.

use crate::ground::{Ground, HIGH, LOW, MAILBOX, SHAPE, send};
use rohrpost_mailbox_crash::{Loss, MailboxInfo, Node, Options, Package, Receiver, SendError};
use std::ops::Not;
use std::time::Duration;

/// What each aftermath looks at. `tests/mistaken` has a mistake for each, with which it does not hold.
#[derive(Clone, Copy, Debug)]
enum Check {
    /// No package is torn.
    Whole,
    /// No slot has a package that is not received.
    Drained,
    /// What was sent was received or is counted as lost.
    Accounts,
    /// Each slot takes a package.
    Usable,
    /// There is no room for more.
    Full,
    /// Each package is received.
    Received,
    /// Packages of one sender and priority come in order.
    InOrder,
    /// A slot takes another package once its package was received.
    UsableAgain,
    /// Closing finds the package that waits.
    Closed,
    /// No participant lives.
    Nobody,
    /// The node may be removed.
    Removable,
    /// The node's directory is gone.
    Gone,
}

impl Check {
    fn holds(self, holds: bool, seen: impl std::fmt::Debug) {
        assert!(holds, "check {self:?}: {seen:?}");
    }
}

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
        let (first, second) = (number(&package, 0), number(&package, 4));
        Check::Whole.holds(first.is_some() && first == second.map(Not::not), (first, second));
        packages.extend(first.map(|id| (id, package.head().options.has(Options::REDELIVERED))));
    }
    let info = node.look_at(MAILBOX).unwrap();
    Check::Drained.holds(info.depth == 0, info.depth);
    let found = Found { packages, info };
    let accounted = received(&found.info) + accepted_losses(&found.info);
    Check::Accounts.holds(found.info.sent.abs_diff(accounted) <= deaths, (deaths, accounted, &found));
    found
}

/// The number at this place of a body.
fn number(package: &Package<'_>, at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(package.body().get(at..at + 4)?.try_into().ok()?))
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
        let sent = send(&mut sender, LOW, id);
        Check::Usable.holds(sent.is_ok(), sent);
    }
    let sent = send(&mut sender, LOW, 1);
    Check::Full.holds(matches!(sent, Err(SendError::Full(MAILBOX))), sent);
    let mut received = Vec::new();
    for _ in ids.clone() {
        let package = receiver.receive_timeout(Duration::from_secs(20));
        Check::Received.holds(package.is_some(), &received);
        received.extend(package.and_then(|package| number(&package, 0)));
    }
    Check::InOrder.holds(received.iter().copied().eq(ids), &received);
    let sent = send(&mut sender, HIGH, 1);
    Check::UsableAgain.holds(sent.is_ok(), sent);
    drop(sender);
    let lost = receiver.close();
    Check::Closed.holds(lost == 1, lost);
    empty(ground);
}

/// Nothing lives or stays here.
pub(crate) fn empty(ground: &Ground) {
    let node = Node::open(ground.path()).unwrap();
    let living = node.participants();
    Check::Nobody.holds(living.is_empty(), living);
    Check::Removable.holds(node.remove_if_dead().unwrap(), ground.path());
    Check::Gone.holds(!ground.path().exists(), ground.path());
}

/// Adopts the mailbox, then all of the above.
pub(crate) fn adopt_and_drain(ground: &Ground, deaths: u64) -> Found {
    let mut receiver = ground.join().receiver(MAILBOX, SHAPE).unwrap();
    let found = drain(ground, &mut receiver, deaths);
    all_usable(ground, receiver);
    found
}
