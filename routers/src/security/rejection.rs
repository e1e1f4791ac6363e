//! Why a datagram was not opened.

use crate::frame::{BadFrame, RefusalReason};

/// Why a datagram is not taken, in the order in which it is found out.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
#[repr(usize)]
pub enum Rejection {
    /// It is not sealed.
    #[error("it is not sealed; does that node's configuration say `security = \"keys\"`?")]
    Unsealed,
    /// Sealed with a key that is not ours.
    #[error(
        "it is sealed with a key of an id that we have not; all nodes need the same key file: \
         copy it from the first computer"
    )]
    OtherKey,
    /// Not from another node of ours to this one.
    #[error("it is not from one of our nodes to this one")]
    NotOurs,
    /// From an incarnation of its node, or to one of ours, that is over or has not begun.
    #[error("it is of another incarnation of that node")]
    OtherIncarnation,
    /// It came before, or is so old that it cannot be told.
    #[error("it came before")]
    Replay,
    /// Its seal is not right: made with another key, or altered.
    #[error(
        "its seal is not right: another key with this id, or someone altered it; \
         all nodes need the same key file: copy it from the first computer"
    )]
    Forged,
    /// It comes from another address than the node has that it says it is from.
    #[error("it comes from another address than its node has in our configuration")]
    Address,
    /// In another wire format: nothing more can be said of it.
    #[error("it is of another wire format; run the same version of Rohrpost on all nodes")]
    Version,
}

impl Rejection {
    /// All, in their order.
    pub const ALL: [Self; 8] = [
        Self::Unsealed,
        Self::OtherKey,
        Self::NotOurs,
        Self::OtherIncarnation,
        Self::Replay,
        Self::Forged,
        Self::Address,
        Self::Version,
    ];

    /// What it tells of a peer from which nothing else comes, if it is of that: anybody can write a peer's address on a
    /// datagram.
    pub const fn reason(self) -> Option<RefusalReason> {
        match self {
            Self::Unsealed => Some(RefusalReason::Sealed),
            Self::OtherKey | Self::Forged => Some(RefusalReason::Key),
            Self::Version => Some(RefusalReason::Version),
            Self::NotOurs | Self::OtherIncarnation | Self::Replay | Self::Address => None,
        }
    }

    /// A word for people and programs.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Unsealed => "unsealed",
            Self::OtherKey => "other-key",
            Self::NotOurs => "not-ours",
            Self::OtherIncarnation => "other-incarnation",
            Self::Replay => "replay",
            Self::Forged => "forged",
            Self::Address => "address",
            Self::Version => "version",
        }
    }
}

/// Why a datagram was not opened. Nothing has changed by it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NotOpened {
    /// No datagram of a router of our version.
    #[error(transparent)]
    Bad(#[from] BadFrame),
    /// Not for us to take.
    #[error(transparent)]
    Rejected(#[from] Rejection),
}
