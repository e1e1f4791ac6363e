//! What one datagram says where nothing is sealed and what may not be so: that its sender was started anew, or is far ahead of all that came.
//!
//! It is not taken until another one says the same. So a datagram that is broken, or sent by a stranger, changes nothing, and what it costs
//! to doubt a true one is that one: a router's first datagram to a peer only says that it is there, see [`Outbound`](crate::outbound).

use super::WINDOW;
use crate::frame::FrameHead;

/// What is doubted of one peer at a time.
const KEPT: usize = 4;
/// Another says the same within this time: a router says something each 200 ms, or in each of its slots.
const WITHIN_NS: u64 = 2_000_000_000;

/// What one peer said that is doubted.
#[derive(Debug, Default)]
pub(super) struct Doubt {
    said: [Said; KEPT],
    next: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Said {
    /// 0: nothing.
    incarnation: u64,
    sequence: u64,
    at_ns: u64,
}

impl Doubt {
    /// Whether another datagram has said the same: it was of this incarnation and came shortly before, or was overtaken. If none has, this one is
    /// remembered.
    pub(super) fn is_confirmed(&mut self, now_ns: u64, head: &FrameHead) -> bool {
        let says_so =
            |said: &Said| said.incarnation == head.incarnation && said.sequence.abs_diff(head.sequence) < WINDOW;
        let known = self.said.iter().position(|said| says_so(said) && now_ns.saturating_sub(said.at_ns) <= WITHIN_NS);
        if let Some(place) = known.filter(|place| self.said[*place].sequence != head.sequence) {
            self.said[place] = Said::default();
            return true;
        }
        let place = known.unwrap_or(self.next);
        self.next = if known.is_none() { (self.next + 1) % KEPT } else { self.next };
        self.said[place] = Said { incarnation: head.incarnation, sequence: head.sequence, at_ns: now_ns };
        false
    }
}
