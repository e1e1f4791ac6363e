//! Which packages of declared flows a datagram carries: measured when it has left.

use super::Outbound;
use crate::frame::{HEAD_BYTES, NodeIndex};
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

/// Those of the datagram that was made last: the flow, and when the package was published, ns. As many as fit at most.
#[derive(Debug)]
pub(super) struct Aboard(Vec<(u16, u64)>);

impl Aboard {
    pub(super) fn new(datagram_bytes: usize) -> Self {
        Self(Vec::with_capacity(datagram_bytes.saturating_sub(HEAD_BYTES) / PACKAGE_HEAD_BYTES))
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

impl Outbound {
    /// Whether the datagram that was made last has something aboard for which [`sent`](Self::sent) is to be said.
    pub fn is_measured(&self) -> bool {
        !self.aboard.0.is_empty()
    }

    /// Says that the datagram that was made last has left: that its last bit is at the other computer at this time, ns.
    pub fn sent(&mut self, arrives_ns: u64) {
        for (flow, published_ns) in self.aboard.0.drain(..) {
            self.stats.flows.took(flow, arrives_ns.saturating_sub(published_ns));
        }
    }

    /// The last or only part of a package goes into the datagram.
    pub(super) fn passed(&mut self, peer: NodeIndex, head: &Head, published_ns: u64) {
        self.stats.peer(peer).sent.packages.add(1);
        self.stats.out.passed(head.priority, head.len);
        if let Some(flow) = self.stats.flows.of(head) {
            self.aboard.0.push((flow, published_ns));
        }
    }
}
