//! One time for all nodes: a master says it, slaves measure how far off they are, and each knows how sure it is (seed 002, 2.2.3).
//!
//! ```text
//!  master   ──warm-up──Sync──────────────────────────Reply──▶        Sync: id, cycle, nominal time, epoch, term, error
//!                       t1 ╲            t4 ╱╲                         Reply: t1, t4 as the kernel stamped them
//!  slave                    t2 ──warm-up──t3  t1 ≤ system(t2), system(t3) ≤ t4: an interval that holds the truth
//!
//!  Exchange ─▶ history (narrowest of each half second; rate; interval) ─▶ line (pace of the page) ─▶ record of the node's page
//! ```
//!
//! # What the error bound says
//! *The time of a term* is what its master's page shows; when a master takes over, the time of the new term is the new master's,
//! less what it was off just then, which its own bound states and all its followers add. So within an epoch the time of a term goes on
//! from the one before. A reading's bound contains its distance from the time of the term that the node follows
//! ([`Reading::term`]), provided that clocks keep what [`LIMITS`] say of them, and that
//! a frame never arrives before it leaves. Whose own clock does not (its computer slept, or a time daemon slews it), by a clock that nobody slews, knows
//! nothing of the time until it has measured it anew: [`Clock::look_at_clocks`]. Nothing is assumed of how long a way takes, nor that both ways take equally long.
//! While a network is split, each part may have a master, and so two terms are two times.
//!
//! # Masters
//! Masters are ordered. One that hears no master for [`TAKEOVER_HALF_INTERVALS`] (3.5) intervals, and one interval more for each that stands
//! before it and is not the one that fell silent, takes over: same epoch, its own estimate of the time, the next term. One without
//! time waits longer still, when it has heard of one that has time. So a router that starts listens first; if there is a master, it is
//! its slave, and it stays so until that one fails: each change of master makes the bound a little larger, and none is made without need.
//!
//! A master that is heard but answers nobody hears nobody; it is replaced as if it were silent. In time slots it is given some slots to answer.
//!
//! Of two masters that hear each other, the one that nobody follows yields; if both or neither are followed, that of the lower term.
//! Terms are never shared, since a term has its master's rank in it. Who yields is a slave with the next [`Sync`](message::Sync), so
//! after a split is fixed there is one master after at most two intervals, as long as some of its datagrams arrive. The nodes of the other part slew if they are off by
//! at most [`STEP_MIN_NS`]; else they say so, and the master begins a new epoch, in which they step.
//!
//! # In time slots
//! [`Clock::in_slots`] makes the interval the cycle, and takes from the clock when it sends: [`Clock::poll_in`] is asked window by window,
//! and a Sync leaves in the master's own alone (see [`tdma`](crate::tdma)). Questions wait for a slot, so between t2 and t3 may lie a cycle or more; what
//! clocks drift meanwhile is in the sample. Whoever starts, yields to another master, or turns to one whose time is another goes by
//! nothing until it has measured: by [`Clock::coarse`] it may ask. [`Clock::estimate`] is what slots are found by; its bound leaves
//! out what the master may be off an earlier term, as all nodes are off alike. Whoever becomes master without time of its own goes on by
//! what it heard, from Syncs or from those who have time and hear no master; a time is begun only where for 100 ms and eight cycles nobody who
//! has one was heard. Until others have turned to it, for eight cycles, such a master sends nothing but Syncs.
//!
//! Whoever may be master and is sure of the time stands in for one whose Sync is missing, in its own window: those behind it in the same
//! cycle, those before it in the next, if nobody did. At the third in a row it takes over there and then, unless anything else of the
//! master came. Others turn to it when they have missed two.
//!
//! Where datagrams are sealed, who joins hears frames whose sender has not shown that it lives: [`Clock::overhear`] takes what they say for when to ask,
//! and for a reason not to begin a time yet, for a while.
//!
//! Another configuration is another table: who hears the time of nodes with another digest, or is refused for it, neither begins a time nor goes on with
//! one, but for the part with the greater claim, and that not for long if the others do not yield: see `others`.
//!
//! Nothing here has a socket, a thread or a clock: `shell::clock` has.

#[cfg_attr(
    not(any(test, feature = "broken-variants")),
    allow(dead_code, unreachable_pub, reason = "mistakes are asked for, and none is made")
)]
mod broken;
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

#[cfg(any(test, feature = "broken-variants"))]
pub use broken::Broken;
pub use clock::{Allowed, Clock};
pub use coarse::JOINING_SYNCS;
pub use estimate::TimeEstimate;
pub use follower::Follower;
pub use limits::{ClockLimits, LIMITS};
pub(crate) use steadiness::Steadiness;
pub use steadiness::{Looked, Unsteady};
pub use types::{Exchange, Ignored, InSlots, Reading, Role, SentId, Step, SyncCounts, TimeSettings};

/// The bound of a node that does not know the time.
pub use rohrpost_mailbox::ERROR_UNKNOWN_NS as UNSYNCHRONISED_NS;

use rohrpost_network::{BEND_MAX_PER, FRAME_HEAD_BYTES};

/// Bytes of each datagram of time.
pub const TIME_BYTES: usize = FRAME_HEAD_BYTES + rohrpost_network::TIME_BYTES;
/// See [`ClockLimits::rate_ppb`].
pub const RATE_MAX_PPB: i64 = LIMITS.rate_ppb;
/// See [`ClockLimits::wander_ppb_s`].
pub const WANDER_PPB_S: i64 = LIMITS.wander_ppb_s;
/// From so far on a node steps instead of slewing, which is a new epoch for all.
pub const STEP_MIN_NS: u64 = 5_000_000;
/// Pace may differ so much from the rate while slewing, ns a second: 5 ms take 5 s.
pub const SLEW_MAX_PPB: i64 = 1_000_000_000 / BEND_MAX_PER as i64;
/// Silence of a master, in half intervals, until the first of the others takes over.
pub const TAKEOVER_HALF_INTERVALS: u64 = 7;

/// A moment of the local monotonic clock, and how far off it may be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Stamp {
    /// Local monotonic ns.
    pub ns: u64,
    /// At most so far off, ns.
    pub doubt_ns: u32,
    /// Taken by the kernel where the frame left or came; else by us, before it was handed over or after it was read.
    pub by_kernel: bool,
}

impl Stamp {
    /// A stamp of our own. It makes the way look longer, never shorter, so it needs no doubt.
    pub fn by_us(ns: u64) -> Self {
        Self { ns, doubt_ns: 0, by_kernel: false }
    }
}

/// The reign of one master: later ones are greater, and two masters never have the same.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Term(pub u64);

impl Term {
    /// Before the first.
    pub const NONE: Self = Self(0);

    /// Round 1 is the first; rank 0 stands first among the masters, and before the others of its round.
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

    /// Nobody's.
    pub fn is_none(self) -> bool {
        self.round() == 0
    }
}
