//! Inputs and outputs of a clock.

use super::Term;
use crate::frame::{BadFrame, NodeIndex};
use crate::settings::Settings;
use rohrpost_mailbox::SystemTime;
use std::time::Duration;

/// Settings of a clock.
#[derive(Clone, Debug)]
pub struct TimeSettings {
    /// First byte of the names of this system.
    pub system: u8,
    /// This node.
    pub own: NodeIndex,
    /// Number of nodes of the system.
    pub nodes: u8,
    /// The nodes that may be master, in order.
    pub masters: Vec<NodeIndex>,
    /// Interval of synchronisation, 1 ms to 10 s; the same on all nodes.
    pub interval: Duration,
    /// Digest of the configuration; equal on all nodes.
    pub digest: u64,
    /// Distinguishes this incarnation of the router from its others; not 0.
    pub incarnation: u64,
}

impl TimeSettings {
    /// Settings of the clock of this router.
    pub fn of(router: &Settings, masters: &[NodeIndex], interval: Duration) -> Self {
        let Settings { system, own, digest, incarnation, .. } = *router;
        Self { system, own, nodes: router.nodes.len() as u8, masters: masters.into(), interval, digest, incarnation }
    }
}

/// Role of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// Hears no master; if it has time, its own clock continues it.
    Listening,
    /// Follows a master.
    Slave,
    /// Has or seeks followers.
    Master,
}

/// What to do next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The buffer has a datagram for this node. If it is to be stamped, its id comes back with
    /// [`Clock::sent`](super::Clock::sent).
    Send {
        /// Receiver.
        to: NodeIndex,
        /// Its id, if its stamp matters.
        stamp: Option<SentId>,
    },
    /// Nothing to do before this moment, local monotonic ns, unless a datagram comes.
    Wait {
        /// Until then.
        until_ns: u64,
    },
}

/// A datagram that left.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SentId {
    /// Receiver.
    pub to: NodeIndex,
    /// The sequence in its head.
    pub sequence: u64,
}

/// Why a datagram was ignored. Counted; none of these is an error of this node.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Ignored {
    /// Not of this system, for another node, or of another configuration.
    #[error("from or for somebody else")]
    Stranger,
    /// Of another configuration, or of this one while another is heard: see
    /// [`Clock::parted_by`](super::Clock::parted_by).
    #[error("there are nodes of another configuration")]
    OtherTable,
    /// An unsteady clock measures nothing: see [`Clock::unsteady`](super::Clock::unsteady).
    #[error("this computer's clock is not steady")]
    Unsteady,
    /// Malformed.
    #[error(transparent)]
    Bad(#[from] BadFrame),
    /// From a master that must yield, late, or a duplicate.
    #[error("late, twice, or of a master that must yield")]
    Late,
    /// A reply to no open request.
    #[error("no such request")]
    Unasked,
    /// From an unverified sender, and of no use.
    #[error("of a router that has not shown that it lives")]
    Unproven,
    /// The frames arrived before they left: a wrong stamp.
    #[error("frames that arrived before they left")]
    NegativeDelay,
}

/// Result of [`Clock::reading`](super::Clock::reading).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reading {
    /// System time, its epoch and its bound, by the node's page.
    pub time: SystemTime,
    /// The term that this time follows; its bound is about the time of this term.
    pub term: Term,
    /// System nanoseconds in a billion local ones.
    pub pace_ppb: u64,
    /// Whether the bound is known at all.
    pub synchronised: bool,
}

/// Exchanges that were measured.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Exchanges {
    /// So far.
    pub count: u64,
    /// Whether all stamps of the last were the kernel's.
    pub by_kernel: bool,
}

/// What a clock needs to know of the time slots; see [`TimeShare`](rohrpost_network::TimeShare).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InSlots {
    /// A warm-up goes before each Sync.
    pub warm_ups: bool,
    /// Replies go in the synchronisation window alone.
    pub replies_in_synchronisation: bool,
    /// Assumed longest delay of the fastest of a few Syncs, ns.
    pub delay_max_ns: u64,
    /// Largest error of a node that may send, ns.
    pub allowance_ns: u64,
    /// Each node with slots has one at least this often, ns.
    pub slot_every_ns: u64,
    /// This node and all that may be master have one this often: for requests and replies.
    pub asks_every_ns: u64,
    /// Each node may send a hello at least this often, ns.
    pub hello_every_ns: u64,
}

/// Counters of synchronisation in time slots.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SyncCounts {
    /// Cycles in which this node sent Syncs as the master.
    pub sent: u64,
    /// Cycles in which the master's Sync came.
    pub heard: u64,
    /// Cycles between two of the same master in which none came.
    pub missed: u64,
    /// Cycles in which this node sent Syncs in the master's place.
    pub replacements_sent: u64,
    /// Cycles in which another node did.
    pub replacements_heard: u64,
}
