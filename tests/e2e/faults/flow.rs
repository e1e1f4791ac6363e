//! Numbered data from a mailbox of one node to one of another, and their accounts.

use super::{Field, mailbox_on, router_of};
use crate::harness::{Robot, wait};
use rohrpost::interfaces::{ClassCarried, Links};
use rohrpost::{Class, Priority};
use rohrpost_mailbox::{Label, Loss, Participant, Receiver, SendError, Sender, Shape, Type, local};
use std::time::Duration;

/// Classes that only flows have, so that they have accounts of their own. None is above the class of probes, between
/// which they pass.
pub(super) const PLAIN: Class = Class(60);
pub(super) const URGENT: Class = Class(90);
/// Less important than the calls of tools, and not real time.
pub(super) const BULK: Class = Class(8);
/// More than half of a datagram, and less than one: each datagram carries one package.
pub(super) const ALONE_BYTES: usize = 1000;

/// Sends.
pub(super) struct Source {
    sender: Sender,
    label: Label,
    body: Vec<u8>,
    /// Packages that were accepted; the next has this number.
    pub(super) sent: u64,
}

impl Source {
    /// From one node to the [`Sink`] on another.
    pub(super) fn new(from: &Robot, at: &str, to: &str, class: Class) -> Self {
        let participant = Participant::join(&from.node, rohrpost::Name::NONE).unwrap();
        let label =
            Label { from: mailbox_on(at), kind: Type::data(1), priority: Priority(class.0), ..Label::default() };
        Self { sender: participant.sender(mailbox_on(to)).unwrap(), label, body: vec![0; ALONE_BYTES], sent: 0 }
    }

    /// The next number; false if there is no room for it just now.
    pub(super) fn send(&mut self) -> bool {
        self.body[..8].copy_from_slice(&self.sent.to_le_bytes());
        match self.sender.send(&self.label, &[&self.body]) {
            Ok(()) => self.sent += 1,
            Err(SendError::Full(_)) => return false,
            Err(error) => panic!("{error}"),
        }
        true
    }
}

/// Receives.
pub(super) struct Sink {
    receiver: Receiver,
    /// Received numbers, in order, with their class.
    pub(super) came: Vec<(u8, u64)>,
}

impl Sink {
    pub(super) fn new(robot: &Robot, on: &str) -> Self {
        let participant = Participant::join(&robot.node, rohrpost::Name::NONE).unwrap();
        let shape = Shape { slots: 1024, body_bytes_max: ALONE_BYTES as u16, ..Shape::default() };
        Self { receiver: participant.receiver(mailbox_on(on), shape).unwrap(), came: Vec::new() }
    }

    /// Waits at most so long for a package, and takes all that are there.
    pub(super) fn take(&mut self, patience: Duration) {
        let first = self.receiver.receive_timeout(patience).map(|package| read(&package));
        self.came.extend(first);
        while let Some(package) = self.receiver.try_receive() {
            self.came.push(read(&package));
        }
    }

    /// Numbers of a class.
    pub(super) fn numbers(&self, class: Class) -> Vec<u64> {
        self.came.iter().filter(|(of, _)| *of == class.0).map(|(_, number)| *number).collect()
    }
}

fn read(package: &rohrpost_mailbox::Package<'_>) -> (u8, u64) {
    (package.head().priority.0, u64::from_le_bytes(package.body()[..8].try_into().unwrap()))
}

/// A router's counts of a class.
pub(super) fn carried(links: &Links, class: Class) -> ClassCarried {
    let none = ClassCarried { class: class.0, taken: 0, sent: 0, came: 0, delivered: 0, lost: Vec::new(), age: None };
    links.classes.iter().find(|carried| carried.class == class.0).cloned().unwrap_or(none)
}

/// Packages that a router lost, for any cause.
pub(super) fn lost(carried: &ClassCarried) -> u64 {
    carried.lost.iter().map(|loss| loss.packages).sum()
}

/// Accepted by a mailbox, and lost there; without losses that the sender learned of.
fn lost_in_mailbox(robot: &Robot, name: rohrpost::Name, class: Class) -> u64 {
    let Some(mailbox) = robot.node.look_at(name) else { return 0 };
    let its = mailbox.classes.iter().filter(|row| row.class == Some(class));
    its.flat_map(|row| Loss::ALL.into_iter().filter(|loss| loss.was_accepted()).map(|loss| row.lost(loss))).sum()
}

/// The accounts of a flow that has ended, from `base` to `arm`.
#[derive(Debug)]
pub(super) struct Accounts {
    /// Packages lost on the wire, since the one router sent them and the other never saw them.
    pub(super) wire: u64,
    /// Datagrams that the receiving router counts as lost: those, and others.
    pub(super) datagrams_lost: u64,
    /// Datagrams that carried no package of the flow.
    pub(super) datagrams_other: u64,
    /// What the receiving router did.
    pub(super) arm: ClassCarried,
}

/// Waits until nothing of a class is in flight, and checks that every package is accounted for: sent packages are those
/// received and those that a station on the way counts as lost.
pub(super) fn balance(field: &Field, source: &Source, sink: &mut Sink, class: Class) -> Accounts {
    let (base, arm) = (field.robot("base"), field.robot("arm"));
    let transit = base.name(&router_of("base")).with_local(local::TRANSIT);
    wait("all packages are accounted for", || {
        sink.take(Duration::from_millis(50));
        let (out, inn) = (field.links("base"), field.links("arm"));
        let (of_base, of_arm) = (carried(&out, class), carried(&inn, class));
        let mailbox = lost_in_mailbox(arm, mailbox_on("arm"), class);
        let accounts = Accounts {
            wire: of_base.sent.checked_sub(of_arm.came)?,
            datagrams_lost: inn.peers[0].counters.lost,
            datagrams_other: out.peers[0].sent.datagrams.saturating_sub(of_base.sent),
            arm: of_arm,
        };
        let sums = [
            ("sent, and taken by the router", source.sent, lost_in_mailbox(base, transit, class) + of_base.taken),
            ("taken, and sent to the wire", of_base.taken, of_base.sent + lost(&of_base)),
            ("came, and delivered", accounts.arm.came, accounts.arm.delivered + lost(&accounts.arm)),
            ("delivered, and received", accounts.arm.delivered, sink.numbers(class).len() as u64 + mailbox),
        ];
        let is_even = sums.iter().all(|(_, one, other)| one == other);
        // Gaps are counted in the second after.
        (is_even && accounts.datagrams_lost >= accounts.wire).then_some(accounts)
    })
}
