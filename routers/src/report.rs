//! What the cores tell of: packages that go no further, and what happens to peers.

use crate::counts::Cause;
use crate::frame::{FrameHead, NodeIndex, RefusalReason, ReplicaFrame};
use crate::security::NotOpened;
use rohrpost_mailbox::{Head, SendError};
use std::net::IpAddr;

/// How much of a lost package's body is there to be read: enough for what a call begins with.
pub const BEGINNING_BYTES: usize = rohrpost_network::KEPT_IN_BYTES as usize;

/// Learns of each package that is lost here, once. It may answer its sender; counted it is already.
pub trait Report {
    /// `peer` is where it was to go, or came from; none if nobody knows. `body` is the beginning of its body,
    /// [`BEGINNING_BYTES`] of it at least; less only if it is shorter, or if its first part never came.
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause);
}

impl<R: Report> Report for &mut R {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        (**self).lost(peer, head, body, cause);
    }
}

/// Takes what came from other nodes.
pub trait Deliver: Report {
    /// Puts a package into its mailbox. If that is not possible, [`Report::lost`] follows.
    ///
    /// # Errors
    /// [`NotDelivered`]
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered>;

    /// Takes a part of what a replica needs, or a request for parts; false: not at this port, of no replica of this
    /// node, or a request for which there is no room.
    fn replica(&mut self, _head: &FrameHead, _part: &ReplicaFrame<'_>) -> bool {
        false
    }

    /// Does what time alone makes due. Says whether more is due within milliseconds, though nothing comes.
    fn poll(&mut self, _now_ns: u64) -> bool {
        false
    }

    /// Something happened that people want to know of, each once until it is over.
    fn event(&mut self, event: RouterEvent);
}

impl<D: Deliver> Deliver for &mut D {
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        (**self).deliver(from, head, body)
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        (**self).replica(head, part)
    }

    fn poll(&mut self, now_ns: u64) -> bool {
        (**self).poll(now_ns)
    }

    fn event(&mut self, event: RouterEvent) {
        (**self).event(event);
    }
}

/// Why a package is not in its mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NotDelivered {
    /// Nobody has it open.
    #[error("no such mailbox; is its module running?")]
    NoMailbox,
    /// It is full, and nothing in it is less important.
    #[error("mailbox full")]
    MailboxFull,
    /// Its slots are smaller.
    #[error("larger than the mailbox's slots")]
    TooLarge,
}

impl From<SendError> for NotDelivered {
    fn from(error: SendError) -> Self {
        match error {
            SendError::Full(_) | SendError::InUse(_) => Self::MailboxFull,
            SendError::TooLarge { .. } => Self::TooLarge,
            SendError::NoMailbox(_) | SendError::NoRouter { .. } | SendError::Reclaimed(_) | SendError::Bad(..) => {
                Self::NoMailbox
            }
        }
    }
}

/// A change between routers that people are told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RouterEvent {
    /// A peer is heard: for the first time, or after silence.
    Heard {
        /// Which.
        peer: NodeIndex,
    },
    /// A peer was started anew.
    Restarted {
        /// Which.
        peer: NodeIndex,
    },
    /// Nothing came from a peer for a second.
    Silent {
        /// Which.
        peer: NodeIndex,
    },
    /// A peer is heard, but does not hear us.
    Unheard {
        /// Which.
        peer: NodeIndex,
    },
    /// Its sender is refused: we take nothing from it.
    Refused {
        /// Where it came from.
        source: IpAddr,
        /// The node with that address.
        peer: Option<NodeIndex>,
        /// What differs.
        mismatch: Mismatch,
    },
    /// Datagrams were not taken, since they were not sealed as they must be; told once a second at most.
    Rejected {
        /// Where the last of them came from.
        source: IpAddr,
        /// The node with that address.
        peer: Option<NodeIndex>,
        /// Why that was not taken.
        why: NotOpened,
        /// How many from there since it was told last.
        datagrams: u64,
    },
    /// A peer takes nothing from us.
    Refuses {
        /// Which.
        peer: NodeIndex,
        /// What differs.
        mismatch: Mismatch,
    },
    /// Two routers send as this node: the address is used twice, or an old router did not end.
    Twice {
        /// Which.
        peer: NodeIndex,
    },
}

/// What is not the same on both ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Mismatch {
    /// Why it is refused.
    pub reason: RefusalReason,
    /// Wire version of the other end; ours is [`frame::VERSION`](crate::frame::VERSION).
    pub version: u8,
    /// Digest of the other end, where it was readable.
    pub digest: Option<u64>,
}
