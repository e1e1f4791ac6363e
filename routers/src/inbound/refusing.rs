//! Refusals: of which nodes datagrams are not taken, and how they learn of it, at most once a second each.

use super::{Inbound, REFUSE_EVERY_NS};
use crate::frame::{self, FrameHead, FrameKind, NodeIndex, Refusal, RefusalReason};
use crate::link::{PeerLinkState, SILENT_AFTER_NS};
use crate::report::{Deliver, Mismatch, RouterEvent};
use crate::settings::Settings;
use std::net::IpAddr;

/// A refusal is over after this long without another; the next is reported anew.
const OVER_NS: u64 = 5_000_000_000;

impl Inbound {
    pub(crate) fn peer_at(&self, source: IpAddr) -> Option<NodeIndex> {
        self.settings.node_at(source).filter(|node| *node != self.settings.own)
    }

    pub(super) fn mismatch(&self, source: IpAddr, head: &FrameHead) -> Option<Mismatch> {
        let ours = &self.settings;
        let differs = |reason| Mismatch { reason, version: frame::VERSION, digest: Some(head.digest) };
        if head.digest != ours.digest {
            return Some(differs(RefusalReason::Digest));
        }
        let is_there = self.is_address_of(head.from, source);
        let is_known = is_there && head.from != ours.own && head.to == ours.own && head.system == ours.system;
        (!is_known).then(|| differs(RefusalReason::Stranger))
    }

    pub(super) fn refuse(&mut self, now_ns: u64, source: IpAddr, mismatch: Mismatch, deliver: &mut impl Deliver) {
        let peer = self.peer_at(source);
        let refusing = match peer {
            Some(peer) => {
                let stats = self.stats.peer(peer);
                stats.received.refused.add(1);
                // Sealed, it may be a replay of a peer's earlier configuration: a peer that is heard has ours by now.
                if !self.settings.is_sealed() || self.stats.state(peer, now_ns) != PeerLinkState::Alive {
                    stats.link.refuse(now_ns, mismatch);
                }
                &mut self.peers[usize::from(peer)].refusing
            }
            None => {
                self.stats.foreign.add(1);
                &mut self.strangers
            }
        };
        // Sealed, no refusal is sent: it could not be authenticated.
        if refusing.due.is_none() && !self.settings.is_sealed() {
            refusing.due = Some((source, mismatch.reason));
            self.must_refuse = true;
        }
        let is_over = refusing.last_ns + OVER_NS < now_ns;
        refusing.last_ns = now_ns;
        let is_news = is_over || refusing.told != Some((source, mismatch));
        // Two sources in turns are not reported each time.
        if is_news && refusing.throttle.note(now_ns, OVER_NS).is_some() {
            refusing.told = Some((source, mismatch));
            deliver.event(RouterEvent::Refused { source, peer, mismatch });
        }
    }

    /// A datagram that cannot be opened has a peer's source address, which anybody can forge. So it counts only for a
    /// peer that neither sends nor receives: its callers learn the likely cause in place of silence, and nothing is
    /// lost by it.
    pub(crate) fn suspect(&self, now_ns: u64, peer: NodeIndex, mismatch: Mismatch) {
        let is_away = matches!(self.stats.state(peer, now_ns), PeerLinkState::Silent | PeerLinkState::Refused(_));
        if is_away {
            self.stats.peer(peer).link.refuse(now_ns, mismatch);
        }
    }

    pub(super) fn refused_by(&mut self, now_ns: u64, source: IpAddr, refusal: &Refusal, deliver: &mut impl Deliver) {
        let Some(peer) = self.peer_at(source) else { return self.stats.foreign.add(1) };
        let mismatch = Mismatch { reason: refusal.reason, version: refusal.version, digest: Some(refusal.digest) };
        let stats = self.stats.peer(peer);
        if refusal.reason == RefusalReason::Digest {
            // Not doubted: two times on one wire are worse than none for a moment. A datagram with our configuration
            // ends it.
            stats.link.refuses_us(now_ns, refusal.digest);
        }
        // A node that refuses us does not hear us, and says so after a second. Anybody can forge a refusal where
        // nothing is sealed, so until then it is doubted.
        let heard_ns = stats.link.hears_us_ns.get();
        if heard_ns > 0 && heard_ns + SILENT_AFTER_NS > now_ns {
            return stats.received.old.add(1);
        }
        stats.link.refuse(now_ns, mismatch);
        if self.peers[usize::from(peer)].is_refused_anew(now_ns, mismatch) {
            deliver.event(RouterEvent::Refuses { peer, mismatch });
        }
    }

    pub(super) fn due(&mut self, now_ns: u64) -> Option<(IpAddr, RefusalReason)> {
        let all = self.peers.iter_mut().map(|peer| &mut peer.refusing).chain([&mut self.strangers]);
        let mut waiting = false;
        for refusing in all {
            if refusing.due.is_some() && refusing.not_before_ns <= now_ns {
                refusing.not_before_ns = now_ns + REFUSE_EVERY_NS;
                return refusing.due.take();
            }
            waiting |= refusing.due.is_some();
        }
        self.must_refuse = waiting;
        None
    }

    pub(super) fn refusal(&self, to: IpAddr, reason: RefusalReason, datagram: &mut [u8]) -> usize {
        write_refusal(&self.settings, self.peer_at(to), reason, datagram)
    }
}

/// Writes a refusal of this node to another, which is no node of ours if it has no number; returns its length.
pub(crate) fn write_refusal(
    settings: &Settings,
    to: Option<NodeIndex>,
    reason: RefusalReason,
    datagram: &mut [u8],
) -> usize {
    let Settings { system, own, digest, incarnation, .. } = *settings;
    let to = to.unwrap_or(NodeIndex::MAX);
    let head = FrameHead { kind: FrameKind::Refusal, system, from: own, to, digest, incarnation, sequence: 0 };
    let said = Refusal { version: frame::VERSION, reason, digest }.to_bytes();
    let end = frame::HEAD_BYTES + said.len();
    datagram[..frame::HEAD_BYTES].copy_from_slice(&head.to_bytes(&[&said]));
    datagram[frame::HEAD_BYTES..end].copy_from_slice(&said);
    end
}
