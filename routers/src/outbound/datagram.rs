//! Makes datagrams: of one package without a copy, of many that wait, of one fragment, or a keep-alive.

use super::{DIRECT_HEAD_BYTES, KeepAlive, Outbound, Package, is_stale};
use crate::counts::Cause;
use crate::frame::{self, Fragment, FrameHead, FrameKind, NodeIndex};
use crate::link::{ALIVE_EVERY_NS, TELL_EVERY_NS};
use crate::queue::Place;
use crate::report::Report;
use crate::settings::Settings;
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

/// Where nothing is sealed, the first datagram to a peer is doubted. If nothing else goes to it within this time, a
/// second keep-alive does.
const SAY_AGAIN_NS: u64 = 10_000_000;
/// Where a fragment begins in its datagram.
pub(super) const PART_START: usize = frame::HEAD_BYTES + frame::FRAGMENT_HEAD_BYTES;

impl Outbound {
    /// The bytes before the body of a package that leaves at once with this head.
    pub(super) fn direct(
        &mut self,
        now_ns: u64,
        peer: NodeIndex,
        head: &Head,
        package: &Package<'_>,
    ) -> [u8; DIRECT_HEAD_BYTES] {
        let package_head = head.to_bytes();
        let frame = self.head_bytes(FrameKind::Packages, peer, &[&package_head, package.body]);
        let mut bytes = [0; DIRECT_HEAD_BYTES];
        bytes[..frame::HEAD_BYTES].copy_from_slice(&frame);
        bytes[frame::HEAD_BYTES..].copy_from_slice(&package_head);
        self.aboard.clear();
        self.passed(peer, head, package.published_ns);
        let level = self.levels[usize::from(head.priority.0)];
        self.left(now_ns, peer, DIRECT_HEAD_BYTES + package.body.len(), Some(level));
        bytes
    }

    /// Packs as many whole packages for a peer as fit, level by level between the two; returns the datagram's length.
    /// The first one fits.
    pub(super) fn pack(
        &mut self,
        now_ns: u64,
        (peer, from, last): (NodeIndex, u8, u8),
        datagram: &mut [u8],
        report: &mut impl Report,
    ) -> usize {
        let mut end = frame::HEAD_BYTES;
        let mut level = from;
        while let Some(next) = self.queue.next_level(peer, level) {
            level = next;
            if level > last {
                break;
            }
            let Some(place) = self.queue.first_of(peer, level) else { break };
            let waiting = *self.queue.at(place);
            let size = PACKAGE_HEAD_BYTES + usize::from(waiting.head.len);
            if waiting.fragments > 0 || end + size > datagram.len() {
                if self.in_slots {
                    break;
                }
                // The rest of this level waits; something of a lower level may still fit.
                level += 1;
                continue;
            }
            if is_stale(now_ns, waiting.published_ns) {
                self.drop_out(place, Cause::Stale, report);
                continue;
            }
            let (head, body) = datagram[end..end + size].split_at_mut(PACKAGE_HEAD_BYTES);
            head.copy_from_slice(&waiting.head.to_bytes());
            self.queue.read(place, body);
            end += size;
            self.queue.remove(place);
            self.left_queue(waiting.level);
            self.passed(peer, &waiting.head, waiting.published_ns);
        }
        self.finish(now_ns, (FrameKind::Packages, Some(from)), peer, &mut datagram[..end])
    }

    /// The next fragment of a package that does not fit in a datagram; returns its datagram's length.
    pub(super) fn part(&mut self, now_ns: u64, place: Place, datagram: &mut [u8]) -> usize {
        let waiting = *self.queue.at(place);
        let peer = waiting.peer;
        let start = PART_START;
        let (len, part_bytes) = (usize::from(waiting.head.len), self.datagram_bytes - start);
        let first = if waiting.fragments == 0 { self.stats.peer(peer).sent.datagrams.get() } else { waiting.first };
        let offset = usize::from(waiting.fragments) * part_bytes;
        let size = part_bytes.min(len - offset);
        let (index, count, offset) = (waiting.fragments, len.div_ceil(part_bytes) as u16, offset as u32);
        let part = Fragment { first, index, count, offset, head: waiting.head, bytes: &[] };
        datagram[frame::HEAD_BYTES..start].copy_from_slice(&part.head_bytes());
        self.queue.read(place, &mut datagram[start..start + size]);
        self.queue.part_left(place, first);
        self.stats.peer(peer).sent.fragments.add(1);
        if index + 1 == count {
            self.queue.remove(place);
            self.left_queue(waiting.level);
            self.passed(peer, &waiting.head, waiting.published_ns);
        }
        self.finish(now_ns, (FrameKind::Fragment, Some(waiting.level)), peer, &mut datagram[..start + size])
    }

    /// A keep-alive for a peer; returns the datagram's length.
    pub(super) fn alive(&mut self, now_ns: u64, peer: NodeIndex, datagram: &mut [u8]) -> usize {
        let stats = self.stats.peer(peer);
        let told = stats.link.told(now_ns, stats.received.missing()).to_bytes();
        let end = frame::HEAD_BYTES + told.len();
        datagram[frame::HEAD_BYTES..end].copy_from_slice(&told);
        self.peers[usize::from(peer)].tell_ns = now_ns + TELL_EVERY_NS;
        self.finish(now_ns, (FrameKind::Alive, None), peer, &mut datagram[..end])
    }

    /// Writes the head before the content: of this kind, with packages of this level first. Returns the length.
    pub(super) fn finish(
        &mut self,
        now_ns: u64,
        (kind, level): (FrameKind, Option<u8>),
        to: NodeIndex,
        datagram: &mut [u8],
    ) -> usize {
        let (head, rest) = datagram.split_at_mut(frame::HEAD_BYTES);
        head.copy_from_slice(&self.head_bytes(kind, to, &[rest]));
        self.left(now_ns, to, datagram.len(), level);
        datagram.len()
    }

    /// The bytes before `rest`. The sealing code writes the check over the result of the cipher.
    fn head_bytes(&self, kind: FrameKind, to: NodeIndex, rest: &[&[u8]]) -> [u8; frame::HEAD_BYTES] {
        let Settings { system, own, digest, incarnation, .. } = self.settings;
        let sequence = self.stats.peer(to).sent.datagrams.get();
        let head = FrameHead { kind, system, from: own, to, digest, incarnation, sequence };
        if self.peer_sessions.is_none() {
            let sequence = self.stats.port.first_sequence() + sequence;
            return FrameHead { sequence, ..head }.to_bytes(rest);
        }
        let mut bytes = [0; frame::HEAD_BYTES];
        head.write(0, &mut bytes);
        bytes
    }

    fn left(&mut self, now_ns: u64, to: NodeIndex, bytes: usize, level: Option<u8>) {
        let sent = &self.stats.peer(to).sent;
        sent.datagrams.add(1);
        sent.bytes.add((bytes + self.settings.network.security.tag_bytes()) as u64);
        self.stats.on_wire_bytes.add((bytes + self.pace.overhead_bytes) as u64);
        let is_doubted = self.peer_sessions.is_none() && !self.in_slots && sent.datagrams.get() == 1;
        self.peers[usize::from(to)].quiet_until_ns = now_ns + if is_doubted { SAY_AGAIN_NS } else { ALIVE_EVERY_NS };
        self.pace.left(now_ns, bytes, level);
    }

    /// A peer that needs a keep-alive. If none does, notes when one will.
    pub(super) fn due(&mut self, now_ns: u64) -> Option<NodeIndex> {
        let when = |peer: &KeepAlive| peer.quiet_until_ns.min(peer.tell_ns);
        let reached = self.settings.peers().filter(|node| self.open() & 1 << node != 0);
        let peers = reached.map(|node| (when(&self.peers[usize::from(node)]), node));
        match peers.min() {
            Some((at_ns, node)) if at_ns <= now_ns => Some(node),
            Some((at_ns, _)) => {
                self.alive_ns = at_ns;
                None
            }
            None => {
                self.alive_ns = u64::MAX;
                None
            }
        }
    }
}
