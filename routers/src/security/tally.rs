//! What was not taken, counted by cause; told once a second at most.

use super::rejection::Rejection;
use crate::counts::Count;
use crate::frame::NodeIndex;
use rohrpost_mailbox::Throttle;
use std::sync::Arc;

/// Shortest interval between two reports on one node, ns; all addresses that no node has count as one.
pub const TELL_EVERY_NS: u64 = 1_000_000_000;

/// Counts of one port: by the node with the source address, which any sender can forge.
#[derive(Debug)]
pub struct Rejections {
    /// By node, then those of addresses that no node has.
    sources: Box<[[Count; Rejection::ALL.len()]]>,
}

impl Rejections {
    pub(super) fn new(nodes: NodeIndex) -> Self {
        Self { sources: (0..=nodes).map(|_| Default::default()).collect() }
    }

    /// Datagrams that were not taken. `peer`: none for addresses that no node has.
    pub fn of(&self, peer: Option<NodeIndex>, why: Rejection) -> u64 {
        self.sources[self.place(peer)][why as usize].get()
    }

    fn place(&self, peer: Option<NodeIndex>) -> usize {
        peer.map_or(self.sources.len() - 1, usize::from)
    }
}

/// Counts, in the thread of a port, and says when to tell.
#[derive(Debug)]
pub struct Tally {
    counts: Arc<Rejections>,
    told: Box<[Throttle]>,
}

impl Tally {
    /// Tally of a port; there is one.
    pub fn new(counts: &Arc<Rejections>) -> Self {
        Self { told: vec![Throttle::default(); counts.sources.len()].into(), counts: counts.clone() }
    }

    /// Counts a datagram; if it is to be told, how many were not taken since that was done last, with this one.
    pub fn note(&mut self, now_ns: u64, peer: Option<NodeIndex>, why: Rejection) -> Option<u64> {
        let place = self.counts.place(peer);
        self.counts.sources[place][why as usize].add(1);
        self.told[place].note(now_ns, TELL_EVERY_NS)
    }
}
