//! A package of a simulated network, as the books have it.

use rohrpost_mailbox::{Head, Priority, local};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_supervision::lease::{self, Ask};

/// What a caller is told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Answer {
    /// It was run, as this run of all.
    Ran(u32),
    /// It may have been run.
    Interrupted,
    NotRun,
}

/// What a package is for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Role {
    Data,
    /// A try of a call, so many ns after the first.
    Command {
        call: usize,
        /// Its age when it was posted, ns on the caller's clock.
        age_ns: u64,
    },
    Answer {
        call: usize,
        answer: Answer,
    },
    /// A router's answer to a command that it could not deliver. It has no place among those of the module for which it
    /// speaks.
    Report {
        call: usize,
    },
    /// A launch asks the witness of a lease.
    Asked(Ask),
    /// The witness answers a launch.
    Answered(lease::Answer),
    /// Data of the holder of a lease.
    Held {
        /// Place of the lease in the order in which they were given.
        lease: usize,
    },
    /// What nobody needs, from a hostile program: it writes what it likes in its heads, and its router caps no
    /// priority.
    Intruder,
}

impl Role {
    /// Whether its packages stand in an order with those of the same sender, receiver and priority.
    pub(super) fn has_place(self) -> bool {
        !matches!(self, Self::Report { .. } | Self::Held { .. } | Self::Intruder)
    }
}

/// How far a package has come at its sender's side.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum SendStage {
    /// It waits for the router, or was lost there: by the mailbox, which counts it.
    Transit,
    /// Its router has it.
    Accepted,
    /// Its router counted it with a cause.
    Counted,
    /// All of it has left in datagrams.
    Left,
}

#[derive(Clone, Debug)]
pub(crate) struct Package {
    /// Its head when it was posted.
    pub(crate) head: Head,
    /// Where its modules are.
    pub(crate) from_node: NodeIndex,
    /// The node that it is for.
    pub(crate) to_node: NodeIndex,
    pub(crate) role: Role,
    /// When it was posted, true ns.
    pub(crate) posted_ns: u64,
    /// Its place among those of its sender, receiver and priority.
    pub(super) place: u32,
    /// How far it has come.
    pub(crate) way: SendStage,
    /// Life of the router that accepted it.
    pub(crate) life: u32,
    /// When it was published, on its node's monotonic clock.
    pub(super) published_ns: u64,
    /// Its place among all that its router accepted.
    pub(super) ticket: u64,
    /// Datagrams of lower levels that had left when it was accepted.
    pub(super) lower: u64,
    /// It was for a node that its router did not know yet, so that others may go before it.
    pub(super) held: bool,
    /// Whether it came marked as one that was handed out before.
    pub(crate) redelivered: bool,
    /// At each delivery, incarnation of the router that sent it and incarnation of the one that delivered.
    pub(crate) deliveries: Vec<(u64, u32)>,
}

/// As a package may be delivered at most.
pub(super) fn admitted(head: &Head) -> Head {
    let [sender, receiver] = [head.from, head.to].map(|name| name.class().0);
    let most = match head.kind.0 {
        1.. => sender,
        _ if head.to.local() == local::COMMANDS => sender,
        -16383..=-1 => receiver,
        _ => sender.max(receiver),
    };
    Head { priority: Priority(head.priority.0.min(most)), ..*head }
}
