//! Protection against one forged datagram where nothing is sealed: it may claim that its sender was restarted, or is
//! far ahead of all that came.
//!
//! Such a datagram is not taken until another one says the same. So a damaged or forged one changes nothing, and doubt
//! of a true one costs only that one: a router's first datagram to a peer is a keep-alive, see
//! [`Outbound`](crate::outbound).

use super::WINDOW;
use crate::frame::FrameHead;

/// Doubted claims of one peer at a time.
const KEPT: usize = 4;
/// Another must confirm within this time: a router sends every 200 ms, or in each of its slots.
const WITHIN_NS: u64 = 2_000_000_000;

/// Doubted claims of one peer.
#[derive(Debug, Default)]
pub(super) struct Confirmation {
    claims: [DoubtedClaim; KEPT],
    next: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct DoubtedClaim {
    /// 0: nothing.
    incarnation: u64,
    sequence: u64,
    at_ns: u64,
}

impl Confirmation {
    /// Whether another datagram has confirmed this claim: of the same incarnation, and sent shortly before or
    /// reordered. If none has, this one is remembered.
    pub(super) fn is_confirmed(&mut self, now_ns: u64, head: &FrameHead) -> bool {
        let says_so = |claims: &DoubtedClaim| {
            claims.incarnation == head.incarnation && claims.sequence.abs_diff(head.sequence) < WINDOW
        };
        let known =
            self.claims.iter().position(|claims| says_so(claims) && now_ns.saturating_sub(claims.at_ns) <= WITHIN_NS);
        if let Some(place) = known.filter(|place| self.claims[*place].sequence != head.sequence) {
            self.claims[place] = DoubtedClaim::default();
            return true;
        }
        let place = known.unwrap_or(self.next);
        self.next = if known.is_none() { (self.next + 1) % KEPT } else { self.next };
        self.claims[place] = DoubtedClaim { incarnation: head.incarnation, sequence: head.sequence, at_ns: now_ns };
        false
    }
}
