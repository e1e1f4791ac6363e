//! The nodes that have replicas, as a way there knows them.

use crate::frame::NodeIndex;
use crate::outbound::Outbound;

/// What the sending half knows of the nodes that have replicas.
pub(super) trait Peers {
    /// Tells its present life from earlier ones, which may have had other records; 0: none is known.
    fn incarnation_of(&self, peer: NodeIndex) -> u64;
    /// Whether it is there, as far as is known: what is not sent to it now waits for nothing.
    fn is_there(&self, now_ns: u64, peer: NodeIndex) -> bool;
}

impl Peers for Outbound {
    fn incarnation_of(&self, peer: NodeIndex) -> u64 {
        self.incarnation_of(peer)
    }

    fn is_there(&self, now_ns: u64, peer: NodeIndex) -> bool {
        self.is_there(now_ns, peer)
    }
}
