//! Which packages of declared flows a datagram carries: measured when it has left.

use super::Outbound;
use crate::frame::{HEAD_BYTES, NodeIndex};
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

/// Those of the last datagram.
#[derive(Debug)]
pub(super) struct Aboard {
    /// The flow, and when the package was published, ns. Limited by what fits in a datagram.
    packages: Vec<(u16, u64)>,
    /// From then on all slots were kept, ns.
    kept_since_ns: u64,
}

impl Aboard {
    pub(super) fn new(datagram_bytes: usize) -> Self {
        let room = datagram_bytes.saturating_sub(HEAD_BYTES) / PACKAGE_HEAD_BYTES;
        Self { packages: Vec::with_capacity(room), kept_since_ns: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.packages.clear();
    }
}

impl Outbound {
    /// Whether the last datagram carries something that needs a call of [`sent`](Self::sent).
    pub fn is_measured(&self) -> bool {
        !self.aboard.packages.is_empty()
    }

    /// The last datagram has left: its last bit is at the other computer at this time, ns.
    pub fn sent(&mut self, arrives_ns: u64) {
        for (flow, published_ns) in self.aboard.packages.drain(..) {
            let kept = published_ns >= self.aboard.kept_since_ns;
            self.stats.flows.took(flow, arrives_ns.saturating_sub(published_ns), kept);
        }
    }

    /// A slot was left out or cut short before this time, ns: no bound holds for packages that were published before.
    pub fn slot_left_out(&mut self, now_ns: u64) {
        self.aboard.kept_since_ns = now_ns;
    }

    /// The last or only fragment of a package goes into the datagram.
    pub(super) fn passed(&mut self, peer: NodeIndex, head: &Head, published_ns: u64) {
        self.stats.peer(peer).sent.packages.add(1);
        self.stats.out.passed(head.priority, head.len);
        if let Some(flow) = self.stats.flows.of(head) {
            self.aboard.packages.push((flow, published_ns));
        }
    }
}
