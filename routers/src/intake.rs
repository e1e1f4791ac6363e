//! What a router with time slots takes from its mailbox, and when.
//!
//! ```text
//!  between slots                             shortly before the call              in the slot, before each datagram
//!  all stays in the mailbox; if that has     as much as the slot has room for,    a few that leave next; others while
//!  more than half of its slots full: ─▶      the most important first: ─▶         the wire is busy: ─▶             queue
//! ```
//!
//! The mailbox outlives a killed router, the queue does not: so packages wait for a slot in the mailbox. A flood is
//! taken out of it, since quotas hold in the queue. If no slot came for long, all is taken: the sender of a package
//! that cannot leave must be told.
//!
//! No mailbox and no clock here: the platform of a [driver](crate::driver) has them.

use crate::admission::capped;
use crate::outbound::Accepted;
use rohrpost_mailbox::{HEAD_BYTES, Head, Priority};
use rohrpost_network::HAND_OVER;

/// If no slot came for this long, waiting packages are taken: the queue finds out whether the peer is there, and
/// whether they are too old. A third of the time after which packages are dropped.
pub(crate) const UNTAKEN_NS_MAX: u64 = crate::outbound::WAIT_MAX_NS / 3;
/// Packages taken at a time: as many as the mailbox may hold.
const BURST: usize = 64;
/// Before a datagram, at most this many of its level are taken, and of those with a claimed priority above the
/// permitted one, since it is handed over at once. The rest has its turn before the next.
pub(crate) const FEW: usize = 4;
/// Nothing is taken between slots with less time than this until the wake-up: taking one takes some ten microseconds.
pub(crate) const LEFT_NS_MIN: u64 = 50_000;
/// Time to take a package, about, ns.
pub const TAKING_NS: u64 = 10_000;
/// Longest time from making a datagram to its handover, unless the thread is stalled, ns.
pub const MAKING_NS: u64 = 10_000;
/// In this time before the call nothing is begun that might last until then, ns.
pub const QUIET_NS: u64 = 20_000;
const _: () = assert!(TAKING_NS + MAKING_NS <= HAND_OVER.as_nanos() as u64, "bounds have room for both");

/// A router's mailbox, and the queue behind it.
pub trait Transit {
    /// Number of packages in the mailbox, and the priority of the first.
    fn waits(&mut self) -> (usize, Option<Priority>);
    /// Capacity of the mailbox.
    fn slots(&self) -> usize;
    /// The first level on which something waits in the queue.
    fn queued(&self) -> Option<u8>;
    /// The level of this priority there.
    fn level(&self, priority: Priority) -> u8;
    /// Local time, ns.
    fn local_ns(&self) -> u64;
    /// Moves the most important package into the queue: its head, and the result. None if there is none.
    fn take(&mut self) -> Option<(Head, Accepted)>;
}

/// What the next slot still needs from the mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Intake {
    /// Bytes of the slot that are not yet filled.
    room_bytes: usize,
    /// The least important of the packages taken for the slot.
    least: Priority,
    /// When there was a slot, or all was taken, ns.
    taken_ns: u64,
}

impl Intake {
    /// Estimate of a router that begins now; no slot has come yet.
    pub fn new(now_ns: u64) -> Self {
        Self { room_bytes: 0, least: Priority(u8::MAX), taken_ns: now_ns }
    }

    /// The next slot carries at most this many bytes.
    pub fn open(&mut self, now_ns: u64, room_bytes: usize) {
        *self = Self { room_bytes, ..Self::new(now_ns) };
    }

    /// The slot is over: waiting packages wait for the next.
    pub fn close(&mut self) {
        (self.room_bytes, self.least) = (0, Priority(u8::MAX));
    }

    /// Before the call: takes the next package, if the slot needs it; returns whether it took one.
    pub fn take_one(&mut self, transit: &mut impl Transit) -> bool {
        (self.room_bytes > 0 || self.is_outranked(transit)) && self.take(transit).is_some()
    }

    /// In the slot, before each datagram: takes what leaves next and a few that may go with it; less important ones
    /// only while the wire is busy. Bounds include the time to take and hand over each package of its level, but none
    /// for lower levels. `busy_ns` says for how long the wire is still busy at a local time, ns.
    pub fn take_on(&mut self, transit: &mut impl Transit, busy_ns: impl Fn(u64) -> u64) {
        let (mut hurried, mut beside) = (0, 0);
        for _ in 0..BURST {
            let queued = transit.queued();
            if !self.is_next(transit, queued, beside < FEW) || queued.is_some() && hurried >= FEW {
                break;
            }
            let Some(head) = self.take(transit) else { break };
            hurried += usize::from(hurries(&head));
            beside += usize::from(transit.queued() == Some(transit.level(head.priority)));
        }
        for _ in 0..BURST {
            let has_time = busy_ns(transit.local_ns()) > TAKING_NS + MAKING_NS;
            let wants = has_time && (self.room_bytes > 0 || self.is_outranked(transit) || is_full(transit));
            if !wants || self.take(transit).is_none() {
                return;
            }
        }
    }

    /// Between slots: takes all if it is much, or if there was no slot for long. It lasts until `wake_ns`, local
    /// time, at most.
    pub fn relieve(&mut self, now_ns: u64, transit: &mut impl Transit, wake_ns: u64) {
        if is_full(transit) || now_ns.saturating_sub(self.taken_ns) > UNTAKEN_NS_MAX {
            self.taken_ns = now_ns;
            let mut taken = 0;
            while taken < BURST
                && wake_ns.saturating_sub(transit.local_ns()) > LEFT_NS_MIN
                && self.take(transit).is_some()
            {
                taken += 1;
            }
        }
    }

    /// Whether the first in the mailbox leaves before all that is queued, or, if there may be more of its level,
    /// together with it.
    fn is_next(&self, transit: &mut impl Transit, queued: Option<u8>, more: bool) -> bool {
        let (_, first) = transit.waits();
        let wants = self.room_bytes > 0 || self.is_outranked(transit) || is_full(transit);
        match (first.map(|first| transit.level(first)), queued) {
            (Some(first), Some(queued)) => first < queued || first == queued && more && wants,
            (Some(_), None) => wants,
            (None, _) => false,
        }
    }

    /// Whether something more important waits than what was taken.
    fn is_outranked(&self, transit: &mut impl Transit) -> bool {
        transit.waits().1.is_some_and(|first| first.outranks(self.least))
    }

    /// Takes the most important package, if there is one.
    fn take(&mut self, transit: &mut impl Transit) -> Option<Head> {
        let (head, accepted) = transit.take()?;
        // A lost package takes no room. One with a claimed priority above the permitted one stands further behind in
        // the queue.
        if accepted == Accepted::Waits && !hurries(&head) {
            self.room_bytes = self.room_bytes.saturating_sub(HEAD_BYTES + usize::from(head.len));
            self.least = self.least.at_most(head.priority);
        }
        Some(head)
    }
}

/// Whether the mailbox may soon lack room for a burst.
fn is_full(transit: &mut impl Transit) -> bool {
    2 * transit.waits().0 > transit.slots()
}

/// Whether a package stands further ahead in the mailbox than it may in the queue, see
/// [`Outbound::accept`](crate::outbound::Outbound::accept).
pub fn hurries(head: &Head) -> bool {
    head.priority.outranks(capped(head).priority)
}
