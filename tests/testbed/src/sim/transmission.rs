//! A datagram on the wire of a network with time slots, and by what its node sends.

use rohrpost_routers::time::{Term, TimeEstimate};

/// Source of the time from which a node computes its windows.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) enum Basis {
    /// Time that it has measured, or its own as a master.
    #[default]
    Own,
    /// What it has heard only: it asks what time it is.
    Heard {
        /// All that it heard was on its way for too long.
        is_misled: bool,
    },
    /// What it has heard of nodes that have not shown that they live: it asks whether they do.
    Overheard {
        /// Somebody repeats what they said once, or it was on its way for too long.
        is_misled: bool,
    },
    /// A time that it began: it only says so.
    Begins {
        /// Since when, true ns.
        since_ns: u64,
    },
}

impl Basis {
    /// Whether it cannot know better.
    pub(crate) fn is_misled(self) -> bool {
        matches!(self, Self::Heard { is_misled: true } | Self::Overheard { is_misled: true })
    }
}

/// The time basis of a transmission, and the term that it follows.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct SendBasis {
    /// By what it finds its windows.
    pub(crate) basis: Basis,
    /// Of its configuration.
    pub(crate) digest: u64,
    /// The term of that time, as far as it knows.
    pub(crate) term: Term,
    /// The line by which it reckons.
    pub(crate) estimate: Option<TimeEstimate>,
}

/// A datagram that is being transmitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transmission {
    pub(crate) node: usize,
    pub(crate) basis: Basis,
    /// Of its configuration.
    pub(crate) digest: u64,
    /// The term of the time that it keeps.
    pub(crate) term: Term,
    /// The master of that term.
    pub(crate) master: Option<usize>,
    /// First and last bit, true ns.
    pub(crate) begin_ns: u64,
    pub(crate) end_ns: u64,
}

impl Transmission {
    pub(super) fn meets(&self, other: &Self) -> bool {
        self.begin_ns < other.end_ns && other.begin_ns < self.end_ns
    }
}
