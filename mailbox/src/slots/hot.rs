//! What senders and receiver tell each other besides the slots' words: tickets, hints, whether to ring, whether to
//! alert.
//!
//! None of it is the truth about a package; that is its word alone. All of it may be lost with a process that dies
//! before it says it, and is then found by looking at the words (see the table in `protocol`).

use crate::name::Priority;
use crate::slots::protocol::{SLOTS_MAX, Slots};
use crate::step::step;
use crate::sync::{AtomicU32, AtomicU64, Ordering, fence, prefetch_to_write, seq_cst_accesses};

/// Words of ready hints, one bit a slot.
pub(crate) const HINT_WORDS: usize = SLOTS_MAX / 64;

/// Something in cache lines of its own: 128 bytes, since processors fetch lines in pairs.
#[derive(Default)]
#[repr(C, align(128))]
pub(crate) struct CacheLine<T>(pub(crate) T);

/// What senders and receiver touch with every package, each part in lines of its own: what counts is how often a line
/// goes from one processor to the other.
#[derive(Default)]
#[repr(C)]
pub(crate) struct Hot {
    /// Senders': the next ticket, that is, the order of publishing. Also the count of packages ever accepted here (one
    /// too many for each sender that was killed between its ticket and its word).
    pub(crate) ticket: CacheLine<AtomicU64>,
    /// Slots that may have become ready. Hints: each is set after its word changed, and may be late or stale.
    pub(crate) ready: CacheLine<[AtomicU64; HINT_WORDS]>,
    /// Written by the receiver and seldom, read by senders with every package.
    pub(crate) receiver: CacheLine<ReceiverSays>,
    /// Not 0: a sender has published something above the level. Written by senders seldom, read by the receiver with
    /// every package.
    pub(crate) alert: CacheLine<AtomicU32>,
}

/// What the receiver tells senders.
#[derive(Default)]
#[repr(C)]
pub(crate) struct ReceiverSays {
    /// Not 0: it sleeps or is about to; see [`rings`].
    pub(crate) sleeping: AtomicU32,
    /// It has looked at all hints, and receives packages of this priority without looking again: the sender of a more
    /// important one says so by `alert`.
    pub(crate) level: AtomicU32,
    /// Not 0: this mailbox has been given up; what is sent here is not received.
    pub(crate) retired: AtomicU32,
}

/// `sleeping` of a receiver that wakes up for every package; for those above a priority alone, it is more by one and
/// the priority.
const FOR_ALL: u32 = 1;

/// Whether a package of this priority is to ring the bell of a receiver that says this of its sleep.
pub(crate) fn rings(sleeping: u32, priority: Priority) -> bool {
    sleeping != 0 && u32::from(priority.0) + FOR_ALL + 1 > sleeping
}

impl Slots<'_> {
    /// Says that a slot became ready.
    pub(crate) fn hint(&self, slot: usize) {
        // ORDERING: Release; pairs with the receiver's swap, which then sees the word this hint speaks of. SeqCst for
        // (E).
        self.hot.ready.0[slot / 64].fetch_or(1 << (slot % 64), Ordering::SeqCst);
    }

    /// Whether this mailbox has been given up.
    pub(crate) fn is_retired(&self) -> bool {
        self.hot.receiver.0.retired.load(Ordering::Relaxed) != 0
    }

    // ---- the receiver ----

    /// Says that the receiver is about to sleep. Look at the hints after this, then sleep, then [`Slots::awake`].
    pub(crate) fn drowsy(&self) {
        self.drowsy_until(FOR_ALL);
    }

    /// The same of one that sleeps on for all that is not above this priority.
    pub(crate) fn drowsy_above(&self, priority: Priority) {
        self.drowsy_until(FOR_ALL + 1 + u32::from(priority.0));
    }

    fn drowsy_until(&self, sleeping: u32) {
        // ORDERING: Release, at least; a sender that sees this owner asleep sees which bell to ring. Pairs with the
        // load in `publish`.
        self.hot.receiver.0.sleeping.store(sleeping, Ordering::SeqCst);
        // ORDERING (F): `sleeping` before the last look at the hints. Pairs with (E).
        seq_cst_accesses();
    }

    /// Says that the receiver does not sleep. It alone says so: a sender that did would swallow the next one's wake-up.
    pub(crate) fn awake(&self) {
        self.hot.receiver.0.sleeping.store(0, Ordering::Relaxed);
    }

    /// Prefetches the hints' cache line for writing. A read first would fetch the line twice. A receiver that looks
    /// again and again keeps it, and nothing moves until a sender takes it.
    pub(crate) fn expect_hints(&self) {
        prefetch_to_write(&raw const self.hot.ready);
    }

    /// Whether a hint is set. SeqCst for (F): the look before a sleep.
    pub(crate) fn any_hint(&self) -> bool {
        self.hot.ready.0[..self.count().div_ceil(64)].iter().any(|hints| hints.load(Ordering::SeqCst) != 0)
    }

    /// Whether something above the level was published.
    pub(crate) fn is_alerted(&self) -> bool {
        self.hot.alert.0.load(Ordering::Relaxed) != 0
    }

    /// Clears the alert. Look at the hints after this.
    pub(crate) fn heed(&self) {
        // ORDERING: Acquire; whatever this clears, its hint is seen. Pairs with the swap in `publish`. Release, so that
        // a swap after this one still hands on what came before.
        self.hot.alert.0.swap(0, Ordering::AcqRel);
    }

    /// From now on a sender of something above this alerts. Raised: a sender that has read the old level alerts for
    /// nothing, and Relaxed will do: the next lowering is ordered against all that read this.
    pub(crate) fn raise_level(&self, level: Priority) {
        self.hot.receiver.0.level.store(level.0.into(), Ordering::Relaxed);
    }

    /// The same, when the level sinks: then look at the hints once more.
    pub(crate) fn lower_level(&self, level: Priority) {
        self.hot.receiver.0.level.store(level.0.into(), Ordering::SeqCst);
        // ORDERING (J): the level before the look at the hints. Pairs with (E): that look sees each sender that has
        // read the higher level and therefore did not alert.
        seq_cst_accesses();
        step!("level: lowered");
    }

    /// Gives the mailbox up for good. Senders see it after publishing and send anew elsewhere.
    pub(crate) fn retire(&self) {
        self.hot.receiver.0.retired.store(1, Ordering::Relaxed);
        // ORDERING (G): `retired` before the owner's last look at the words. Pairs with (E).
        fence(Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleeper_above_a_priority_is_rung_for_what_is_above_it_alone() {
        let above = |priority: u8| FOR_ALL + 1 + u32::from(priority);
        for (sleeping, priority, wakes, why) in [
            (0, 255, false, "nobody sleeps"),
            (FOR_ALL, 0, true, "for every package"),
            (above(0), 0, false, "not above"),
            (above(0), 1, true, "above"),
            (above(127), 127, false, "the most that is not above"),
            (above(127), 128, true, "the least that is"),
            (above(255), 255, false, "nothing is above all"),
        ] {
            assert_eq!(rings(sleeping, Priority(priority)), wakes, "{why}");
        }
    }
}
