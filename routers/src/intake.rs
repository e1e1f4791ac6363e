//! What a router with time slots takes from its mailbox, and when.
//!
//! ```text
//!  between slots                             shortly before the call              in the slot, a few before each datagram
//!  all stays in the mailbox; if that has     as much as the slot has room for,    what still has room, or is more important
//!  more than half of its slots full: ─▶      the most important first: ─▶         than what was taken, or too much: ─▶   queue
//! ```
//!
//! The mailbox outlives a router that is killed, the queue does not: so what waits for a slot waits in the mailbox. A flood is taken out of it,
//! since quotas hold in the queue. So is all, if no slot came for long: what cannot leave must be told so to its sender.
//!
//! No mailbox and no clock here: the thread of the time slots has them (`shell::slots`), and the simulation.

use crate::outbound::Accepted;
use rohrpost_mailbox::{HEAD_BYTES, Head, Kind, Priority};

/// If no slot came for so long, what waits is taken: whether its peer is there, and whether it is too old, is found in the queue. A third of
/// the time after which packages are dropped.
pub(crate) const UNTAKEN_NS_MAX: u64 = crate::outbound::WAIT_MAX_NS / 3;
/// Packages taken at a time: all that the mailbox may hold.
const BURST: usize = 64;
/// Before each datagram of a slot at most so many, since it is to be handed over at once: the rest has its turn before the next. Bounds
/// count on one only, for they give each package a datagram of its own.
pub(crate) const FEW: usize = 4;
/// Nothing more is taken between slots with less than this until the thread has to wake up: to take one lasts for some ten microseconds.
pub(crate) const LEFT_NS_MIN: u64 = 50_000;

/// A router's mailbox, and the queue behind it.
pub trait Transit {
    /// How many packages wait in the mailbox, and how important the first is.
    fn waits(&mut self) -> (usize, Option<Priority>);
    /// How many it holds.
    fn slots(&self) -> usize;
    /// Whether something waits in the queue.
    fn has_queued(&self) -> bool;
    /// Takes the most important package into the queue: its head, and what became of it. None if there is none.
    fn take(&mut self) -> Option<(Head, Accepted)>;
}

/// What the coming slot still wants of the mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Intake {
    /// What was taken for the slot leaves room for so many bytes.
    room_bytes: usize,
    /// The least important of what was taken for the slot.
    least: Priority,
    /// When there was a slot, or all was taken, ns.
    taken_ns: u64,
}

impl Intake {
    /// Of a router that begins now; no slot has come yet.
    pub fn new(now_ns: u64) -> Self {
        Self { room_bytes: 0, least: Priority(u8::MAX), taken_ns: now_ns }
    }

    /// A slot comes that carries at most so many bytes.
    pub fn open(&mut self, now_ns: u64, room_bytes: usize) {
        *self = Self { room_bytes, ..Self::new(now_ns) };
    }

    /// It is over: what waits now waits for the next.
    pub fn close(&mut self) {
        (self.room_bytes, self.least) = (0, Priority(u8::MAX));
    }

    /// Before the call: takes the next package, if the slot wants it; whether it took one.
    pub fn take_one(&mut self, transit: &mut impl Transit) -> bool {
        (self.room_bytes > 0 || self.is_outranked(transit)) && self.take(transit)
    }

    /// In the slot, before each datagram: takes a few, and more only while there is nothing to send.
    pub fn take_on(&mut self, transit: &mut impl Transit) {
        for taken in 0..BURST {
            let has_enough = taken >= FEW && transit.has_queued();
            let wants = self.room_bytes > 0 || self.is_outranked(transit) || is_full(transit);
            if has_enough || !wants || !self.take(transit) {
                return;
            }
        }
    }

    /// Between slots: takes all if it is much, or if there was no slot for long. `left_ns` says how long it may last.
    pub fn relieve(&mut self, now_ns: u64, transit: &mut impl Transit, mut left_ns: impl FnMut() -> u64) {
        if is_full(transit) || now_ns.saturating_sub(self.taken_ns) > UNTAKEN_NS_MAX {
            self.taken_ns = now_ns;
            let mut taken = 0;
            while taken < BURST && left_ns() > LEFT_NS_MIN && self.take(transit) {
                taken += 1;
            }
        }
    }

    /// Whether something waits that is more important than what was taken.
    fn is_outranked(&self, transit: &mut impl Transit) -> bool {
        transit.waits().1.is_some_and(|first| first.outranks(self.least))
    }

    /// Takes the most important package; whether there was one.
    fn take(&mut self, transit: &mut impl Transit) -> bool {
        let Some((head, accepted)) = transit.take() else { return false };
        // What is lost takes no room; and who hurries more than it may stands further behind in the queue.
        if accepted == Accepted::Waits && !hurries(&head) {
            self.room_bytes = self.room_bytes.saturating_sub(HEAD_BYTES + usize::from(head.len));
            self.least = self.least.at_most(head.priority);
        }
        true
    }
}

/// Whether the mailbox may have no room for a burst soon.
fn is_full(transit: &mut impl Transit) -> bool {
    2 * transit.waits().0 > transit.slots()
}

/// Whether a package stands further ahead in the mailbox than its sender may have it in the queue, see [`Outbound::accept`](crate::outbound::Outbound::accept).
fn hurries(head: &Head) -> bool {
    matches!(head.kind.kind(), Kind::Command(_)) && head.priority.outranks(head.from.class().priority())
}
