//! Why a package was not accepted.

use crate::name::Name;

/// Why a package could not be sent. It was not accepted; nothing is lost that its sender does not know of.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// Nobody on this node has made such a mailbox, and no router takes it further.
    #[error("mailbox {0}: not on this node, and no router leads to it; is its module launched?")]
    NoMailbox(Name),
    /// It is on another node, but the router that takes packages there has no mailbox here.
    #[error("mailbox {name} is on another node, and the router that leads there, {router}, does not run; start it")]
    NoRouter {
        /// Where it should go.
        name: Name,
        /// The router's mailbox for such packages.
        router: Name,
    },
    /// All slots are in use by packages as important or more.
    #[error("mailbox {0} is full; its receiver is slow or stopped, or it has too few slots")]
    Full(Name),
    /// Larger than the mailbox's slots.
    #[error(
        "mailbox {name} takes bodies of at most {max} bytes, this one has {len}; raise its `size` in the configuration"
    )]
    TooLarge {
        /// Where it should go.
        name: Name,
        /// Bytes of the body.
        len: usize,
        /// Bytes that fit.
        max: usize,
    },
    /// This participant sends to that mailbox already and may not hold more claims there.
    #[error("mailbox {0}: this participant has as many senders there as the mailbox's `claims` allows; share one")]
    InUse(Name),
    /// This process looked dead to the receiver, which took the slot back.
    #[error("mailbox {0}: its receiver held this process for dead; was the node's directory removed?")]
    Reclaimed(Name),
    /// The segment cannot be used.
    #[error("mailbox {0}: {1}")]
    Bad(Name, String),
}
