//! What a router of the team counts: packages by class and cause, datagrams, and those that it refused.

use crate::counts::Count;
use crate::session::SessionCounts;

rohrpost_mailbox::causes! {
    /// Why a datagram from another system was refused.
    pub enum TeamRefusal {
        /// No datagram of a router of a team.
        Foreign = "foreign",
        /// Of another version of the format.
        Version = "version",
        /// Damaged on its way, or made wrong.
        Damaged = "damaged",
        /// Not sealed, or with a key or content that is not ours.
        Unsealed = "unsealed",
        /// Sealed, and here nothing is.
        Sealed = "sealed",
        /// From a system that numbers its classes otherwise.
        Classes = "classes",
        /// From an incarnation that has not proved that it lives now.
        Unproven = "unproven",
        /// A copy, or too old to tell.
        Duplicate = "duplicate",
        /// From an incarnation after its successor was heard.
        Ended = "ended",
        /// From one more than are remembered.
        Crowded = "crowded",
        /// Another computer sends in the name of this node.
        OwnName = "own-name",
    }
}

/// Counts of a router of the team. They only grow.
#[derive(Debug, Default)]
pub struct TeamCounts {
    /// Packages for other systems.
    pub out: SessionCounts,
    /// Packages from other systems.
    pub inn: SessionCounts,
    /// Datagrams that were sent, each peer counted.
    pub sent: Count,
    /// Datagrams that came.
    pub came: Count,
    /// Packages that had come by the other way already.
    pub copies: Count,
    refused: [Count; TeamRefusal::ALL.len()],
}

impl TeamCounts {
    /// Datagrams refused for a cause.
    pub fn refused(&self, why: TeamRefusal) -> u64 {
        self.refused[why as usize].get()
    }

    pub(super) fn refuse(&self, why: TeamRefusal) {
        self.refused[why as usize].add(1);
    }
}
