//! Datagrams that are filled by other code: parts of replicas. Here they get their head, and count as any other.

use super::Outbound;
use crate::frame::{self, FrameKind, NodeIndex};
use crate::link::PeerLinkState;
use crate::stats::Stats;
use std::sync::Arc;

impl Outbound {
    /// From now on it sends at the rate that these leave as well.
    #[must_use]
    pub(crate) fn yielding_to(mut self, others: &Arc<Stats>) -> Self {
        self.shares_with.push((others.clone(), others.on_wire_bytes.get()));
        self
    }

    /// From now on it sends to these peers alone, one bit each.
    #[must_use]
    pub(crate) fn only_to(self, peers: u64) -> Self {
        Self { only: peers, reached: self.reached & peers, ..self }
    }

    /// Whether a datagram of this level may leave now; else when. In time slots the window says it.
    pub(crate) fn may_leave(&self, now_ns: u64, level: u8) -> Result<(), u64> {
        if self.in_slots { Ok(()) } else { self.pace.may_leave(now_ns, level) }
    }

    /// Notes which peers hear this node: for time slots, in which nothing is polled here.
    pub(crate) fn look_at_peers(&mut self, now_ns: u64) {
        self.look_at_what_is_real_time(now_ns);
    }

    /// Peers to which something may leave now, one bit each.
    pub(crate) fn ready_peers(&self) -> u64 {
        // Sessions as they are now: in time slots nothing is polled here that would look at them.
        let reached = self.peer_sessions.as_ref().map_or(self.reached, |all| all.reached() & self.only);
        reached & !self.full & self.hearing
    }

    /// Whether a peer is there, as far as is known: what is not sent to it now waits for nothing.
    pub(crate) fn is_there(&self, now_ns: u64, peer: NodeIndex) -> bool {
        let state = self.stats.state(peer, now_ns);
        let is_heard = self.hearing & 1 << peer != 0;
        is_heard && matches!(state, PeerLinkState::Unknown | PeerLinkState::Alive)
    }

    /// The incarnation of a peer that is heard; 0: none.
    pub(crate) fn incarnation_of(&self, peer: NodeIndex) -> u64 {
        self.stats.incarnation_of(peer)
    }

    /// Writes the head before so many bytes of content, which stand behind its place; returns the datagram's length.
    pub(crate) fn carry(
        &mut self,
        now_ns: u64,
        (kind, level): (FrameKind, u8),
        to: NodeIndex,
        (datagram, content_bytes): (&mut [u8], usize),
    ) -> usize {
        self.finish(now_ns, (kind, Some(level)), to, &mut datagram[..frame::HEAD_BYTES + content_bytes])
    }
}
