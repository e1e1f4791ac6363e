//! What the books keep of each incarnation of a router: what it sends, and what it takes.

use super::table::{Group, Table};
use rohrpost_mailbox::Name;
use rohrpost_network::LEVELS;
use rohrpost_routers::frame::NodeIndex;
use std::collections::{BTreeSet, VecDeque};

/// Packages that one incarnation of a router has to account for.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub(crate) struct Account {
    /// Taken from its computer.
    pub(crate) accepted: u64,
    /// Sent whole.
    pub(crate) left: u64,
    /// Counted with a cause.
    pub(crate) lost: u64,
}

/// What one incarnation of a router sends.
#[derive(Default, Debug)]
pub(crate) struct Sending {
    pub(crate) account: Account,
    /// Datagrams in which the most urgent package is of a lower level than this.
    pub(super) below: [u64; LEVELS],
    /// Packages of each module that wait.
    pub(super) waiting: Table<Name, WaitingPackages>,
    /// The one that came last.
    pub(super) newest: u32,
    /// All that has left is through then, at the configured rate, on the node's monotonic clock.
    pub(super) through_ns: u64,
    /// The same with what has left by the port of replicas.
    pub(super) all_through_ns: u64,
    /// Level of the most urgent package in the datagram that left last.
    pub(super) last: usize,
}

#[derive(Default, Debug)]
pub(super) struct WaitingPackages {
    /// Level, place among all, number.
    pub(super) packages: BTreeSet<(usize, u64, u32)>,
    pub(super) bytes: usize,
}

/// What one incarnation of a router takes.
#[derive(Default, Debug)]
pub(crate) struct Receiving {
    /// Packages of which something came.
    pub(super) receipts: Table<u32, Receipt>,
    /// Datagrams, by the sender's incarnation.
    pub(super) taken: Table<u64, Taken>,
    /// The incarnation of each peer that was heard last.
    pub(super) present: Table<NodeIndex, u64>,
    /// Incarnation and sequence of each datagram of a peer that was not confirmed, and when it came, local ns.
    pub(super) doubted: Table<NodeIndex, VecDeque<(u64, u64, u64)>>,
    /// Last place that was delivered, of sender, receiver and priority.
    pub(super) last: Table<(Name, Name, u8), u32>,
}

/// What one incarnation of a router has had of a package.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Receipt {
    pub(super) parts: u32,
    /// It was delivered, or counted with a cause.
    pub(super) ended: bool,
}

/// What one incarnation of a router has taken of another.
#[derive(Default, Debug)]
pub(super) struct Taken {
    pub(super) from: NodeIndex,
    pub(super) sequences: Group<u64>,
    /// The first that counts: what went before the beginning is none of ours.
    pub(super) start: u64,
    pub(super) highest: u64,
    /// It was taken for over, and came back: what was missing meanwhile is not counted.
    pub(super) unclear: bool,
    /// With which sequence it came back last.
    pub(super) back: u64,
}
