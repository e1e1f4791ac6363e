//! Datagrams in a time slot: the most important first, as long as they fit.
//!
//! ```text
//!  queue:  level 0 ▓▓  level 3 ▓▓▓▓▓▓▓▓▓  level 9 ▒          room in the slot: ▓▓▓▓▓▓▓
//!          fits: leaves   does not fit: the slot ends        9 does not overtake 3, and 3 goes first in the next slot
//! ```
//!
//! The computed bounds rely on it: before a package nothing less important leaves except what was on the wire already.

use super::datagram::PART_START;
use super::{DIRECT_HEAD_BYTES, Outbound};
use crate::frame::{ALIVE_BYTES, HEAD_BYTES, NodeIndex};
use crate::queue::QueuedPackage;
use crate::report::Report;
use rohrpost_mailbox::Priority;
use rohrpost_network::LEVELS;

impl Outbound {
    /// The next datagram in a time slot: its receiver and its length in the buffer; none when nothing is left that may
    /// leave. `room_bytes`: the longest datagram that is on the wire before the slot's guard begins. `datagram` has
    /// room for the largest. `behind`: the most important package that was not accepted yet.
    ///
    /// # Panics
    /// If it has not.
    pub fn poll_slot(
        &mut self,
        now_ns: u64,
        (room_bytes, datagram): (usize, &mut [u8]),
        behind: Option<Priority>,
        report: &mut impl Report,
    ) -> Option<(NodeIndex, usize)> {
        let room_bytes = room_bytes.min(self.datagram_bytes);
        let datagram = &mut datagram[..room_bytes];
        self.aboard.clear();
        self.announce_to_new_sessions();
        if now_ns >= self.alive_ns
            && let Some(peer) = self.due(now_ns)
        {
            let fits = HEAD_BYTES + ALIVE_BYTES <= room_bytes;
            return fits.then(|| (peer, self.alive(now_ns, peer, datagram)));
        }
        while let Some(place) = self.queue.first_among(self.reached) {
            let waiting = *self.queue.at(place);
            if let Some(cause) = self.why_not(now_ns, waiting.peer, waiting.published_ns) {
                self.drop_out(place, cause, report);
                continue;
            }
            if self.takes_bytes(&waiting) > room_bytes {
                return None;
            }
            let bytes = if self.is_large(&waiting) {
                self.part(now_ns, place, datagram)
            } else {
                let last = self.last_level_of_company(waiting.peer, behind).max(waiting.level);
                self.pack(now_ns, (waiting.peer, waiting.level, last), datagram, report)
            };
            return Some((waiting.peer, bytes));
        }
        None
    }

    /// Drops expired packages at the front, so that the next one is known. Call it before each datagram of a slot.
    pub fn drop_first(&mut self, now_ns: u64, report: &mut impl Report) {
        while let Some(place) = self.queue.first_among(self.open()) {
            let waiting = self.queue.at(place);
            let Some(cause) = self.why_not(now_ns, waiting.peer, waiting.published_ns) else { return };
            self.drop_out(place, cause, report);
        }
    }

    /// Drops waiting packages that are too old or have no receiver. Call it between slots.
    pub fn tidy(&mut self, now_ns: u64, report: &mut impl Report) {
        if now_ns >= self.sweep_ns {
            self.sweep(now_ns, report);
        }
    }

    /// Bytes of a package's own datagram; for a package in fragments, of its next.
    fn takes_bytes(&self, waiting: &QueuedPackage) -> usize {
        let len = usize::from(waiting.head.len);
        if !self.is_large(waiting) {
            return DIRECT_HEAD_BYTES + len;
        }
        let left = len - usize::from(waiting.fragments) * (self.datagram_bytes - PART_START);
        self.datagram_bytes.min(PART_START + left)
    }

    /// In a slot a datagram carries nothing less important than what waits for other peers, or in the mailbox: that
    /// would be delayed by the extra bytes.
    fn last_level_of_company(&self, peer: NodeIndex, behind: Option<Priority>) -> u8 {
        let others = self.queue.first_level_besides(peer).unwrap_or(LEVELS as u8);
        let behind = behind.map_or(LEVELS as u8, |first| self.level(first));
        others.min(behind)
    }
}
