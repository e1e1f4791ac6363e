//! One time for all nodes: a master sends it, slaves measure their offset, and each node knows its error bound.
//!
//! ```text
//!  master   ──warm-up──Sync──────────────────────────Reply──▶        Sync: id, cycle, nominal time, epoch, term, error
//!                       t1 ╲            t4 ╱╲                         Reply: t1, t4 as the kernel stamped them
//!  slave                    t2 ──warm-up──t3  t1 ≤ system(t2), system(t3) ≤ t4: an interval that holds the truth
//!
//!  Exchange ─▶ history (narrowest of each half second; rate; interval) ─▶ clock model (pace) ─▶ record of the page
//! ```
//!
//! # What the error bound says
//! *The time of a term* is what its master's page shows. After a change of master, the time of the new term is the new
//! master's time minus its error at the takeover. Its own bound contains that error, and all its followers add it. So
//! within an epoch the time of a term continues the one before. A reading's bound is its distance from the time of the
//! term that the node follows ([`Reading::term`]). It holds as long as clocks stay within [`LIMITS`] and no frame
//! arrives before it leaves. A node that finds its own clock outside [`LIMITS`], by comparison with a clock that
//! nothing slews, knows no time until it has measured it anew: [`Clock::look_at_clocks`]. (The computer slept, or a
//! time daemon slews the clock.) No network delay is assumed, nor that both directions take equally long. While a
//! network is split, each part may have a master: two terms are then two times.
//!
//! # Masters
//! Masters are ordered. A node takes over when it hears no master for [`TAKEOVER_HALF_INTERVALS`] (3.5) intervals, plus
//! one interval for each candidate before it other than the one that fell silent. The epoch stays; the time is the
//! node's own estimate, and the term is the next. A node without time waits longer if it has heard of one that has
//! time. So a router listens when it starts. If there is a master, it becomes a slave, and stays one until that master
//! fails: each change of master makes the bound a little larger, so none is made without need.
//!
//! A master that is heard but answers nobody is deaf, and is replaced like a silent one. In time slots it gets some
//! slots in which to answer.
//!
//! Of two masters that hear each other, the one without followers yields. If both or neither have followers, the one
//! with the lower term yields. Two masters never share a term, since a term contains the rank. A master that yields
//! becomes a slave with the next [`Sync`](message::Sync). So at most two intervals after a split has ended there is one
//! master, if some of its datagrams arrive. The nodes of the other part slew if they are off by at most
//! [`STEP_MIN_NS`]; else they say so, the master begins a new epoch, and they step.
//!
//! # In time slots
//! [`Clock::in_slots`] makes the interval the cycle. The caller decides when to send: it calls [`Clock::poll_in`]
//! window by window, and a Sync leaves in the master's own window alone (see [`tdma`](crate::tdma)). Requests wait for
//! a slot, so between t2 and t3 may lie a cycle or more; the sample contains the drift of the clocks meanwhile. A node
//! that starts, yields to another master, or turns to a master with another time has no time until it has measured:
//! [`Clock::coarse`] lets it ask. [`Clock::estimate`] locates the slots; its bound leaves out the master's error
//! against an earlier term, since all nodes share it. A new master without time of its own continues the time that it
//! heard, from Syncs or from nodes that have time and hear no master. It begins a new time only after it heard no time
//! for 100 ms and eight cycles. For eight cycles, until others follow it, such a master sends only Syncs.
//!
//! A node that may be master and is sure of the time stands in for a master when that one's Sync is missing, in its own
//! window: candidates behind the master in the same cycle, those before it in the next, if no other node did. At the
//! third missing Sync in a row it takes over at once, unless another frame of the master came. Others turn to it when
//! they have missed two.
//!
//! Where datagrams are sealed, a joining node hears frames of unverified senders. [`Clock::overhear`] uses them to
//! decide when to ask, and delays a new time because of them, for a limited while.
//!
//! Another configuration has another slot table. A node that hears the time of nodes with another digest, or that is
//! refused for its digest, neither begins nor continues a time. Only the part with the greater claim continues, and not
//! for long if the others do not yield: see `others`.
//!
//! Nothing here has a socket, a thread or a clock: `shell::clock` has.

mod clock;
mod clock_model;
mod coarse;
mod election;
mod estimate;
mod follower;
mod history;
mod limits;
pub mod message;
mod others;
mod steadiness;
#[cfg(test)]
mod tests;
mod types;
mod unverified;

pub use clock::{Allowed, Clock};
pub use coarse::JOINING_SYNCS;
pub use estimate::TimeEstimate;
pub use follower::Follower;
pub use limits::{ClockLimits, LIMITS};
pub(crate) use steadiness::Steadiness;
pub use steadiness::{Looked, Unsteady};
pub use types::{Exchanges, Ignored, InSlots, Reading, Role, SentId, Step, SyncCounts, TimeSettings};

/// The bound of a node that does not know the time.
pub use rohrpost_mailbox::ERROR_UNKNOWN_NS as UNSYNCHRONISED_NS;

use rohrpost_network::{BEND_MAX_PER, FRAME_HEAD_BYTES};

/// Bytes of each datagram of time.
pub const TIME_BYTES: usize = FRAME_HEAD_BYTES + rohrpost_network::TIME_BYTES;
/// See [`ClockLimits::rate_ppb`].
pub const RATE_MAX_PPB: i64 = LIMITS.rate_ppb;
/// See [`ClockLimits::wander_ppb_s`].
pub const WANDER_PPB_S: i64 = LIMITS.wander_ppb_s;
/// From this offset on a node steps instead of slewing, which is a new epoch for all.
pub const STEP_MIN_NS: u64 = 5_000_000;
/// Largest difference between pace and rate while slewing, ns a second: 5 ms take 5 s.
pub const SLEW_MAX_PPB: i64 = 1_000_000_000 / BEND_MAX_PER as i64;
/// Silence of a master, in half intervals, until the first candidate takes over.
pub const TAKEOVER_HALF_INTERVALS: u64 = 7;

/// A moment of the local monotonic clock, and its error.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Stamp {
    /// Local monotonic ns.
    pub ns: u64,
    /// Largest error, ns.
    pub doubt_ns: u32,
    /// Stamped by the kernel when the frame left or came; else by this process, before the send or after the read.
    pub by_kernel: bool,
}

impl Stamp {
    /// A stamp of this process. It makes the delay look longer, never shorter, so it needs no doubt.
    pub fn by_us(ns: u64) -> Self {
        Self { ns, doubt_ns: 0, by_kernel: false }
    }
}

/// Term of one master: later ones are greater, and two masters never have the same.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Term(pub u64);

impl Term {
    /// Before the first.
    pub const NONE: Self = Self(0);

    /// Round 1 is the first. Rank 0 is the first among the masters, and precedes the others of its round.
    pub fn new(round: u64, rank: u8) -> Self {
        Self(round.min(u64::MAX >> 8) << 8 | u64::from(u8::MAX - rank))
    }

    /// Raised by each master that takes over.
    pub fn round(self) -> u64 {
        self.0 >> 8
    }

    /// The master's place in the order.
    pub fn rank(self) -> u8 {
        u8::MAX - (self.0 & 0xFF) as u8
    }

    /// No master's term.
    pub fn is_none(self) -> bool {
        self.round() == 0
    }
}
