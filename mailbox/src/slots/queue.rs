//! The receiver's private view of a mailbox: which ready slot comes first.
//!
//! Holds hints only, one entry a slot: the word is asked again, by compare-and-swap, when a package is taken.
//! Everything is allocated at the start.

use crate::name::Priority;
use crate::slots::hot::HINT_WORDS;
use crate::slots::protocol::{Slots, Taken};
use crate::slots::word::Word;
use crate::sync::Ordering;

/// Every so many receives one word in turn is marked for the next look, hint or no hint: a sender may have died between
/// publishing and setting it.
const RESCAN_EVERY: u32 = 16;
const ABSENT: u16 = u16::MAX;

/// A level above all priorities: nothing is received without a look at the hints.
const NO_LEVEL: u16 = 256;

/// A binary heap of the ready slots that are known, and the hints that must wait for the next look.
pub(crate) struct Queue {
    /// Greatest rank first. Each entry: the word as it was seen, and its slot.
    heap: Vec<(Word, u16)>,
    /// Where in the heap a slot stands.
    place: Vec<u16>,
    /// Slots to be looked at next time without a hint: those seen with a ticket younger than the look, else a sender's
    /// second package could pass its first; and those that are rescanned.
    deferred: [u64; HINT_WORDS],
    receives: u32,
    /// What senders were told: they alert when they send something above this.
    level: u16,
}

impl Queue {
    pub(crate) fn new(count: usize) -> Self {
        let (heap, place) = (Vec::with_capacity(count), vec![ABSENT; count]);
        Self { heap, place, deferred: [0; HINT_WORDS], receives: 0, level: NO_LEVEL }
    }

    /// Packages known to wait.
    pub(crate) fn len(&self) -> usize {
        self.heap.len()
    }

    /// Whether something may wait that has not been looked at.
    pub(crate) fn may_have_more(&self, slots: &Slots<'_>) -> bool {
        !self.heap.is_empty() || self.has_unseen(slots)
    }

    /// Whether the next look may find something.
    pub(crate) fn has_unseen(&self, slots: &Slots<'_>) -> bool {
        self.deferred.iter().any(|bits| *bits != 0) || slots.any_hint()
    }

    /// Takes the most important, then earliest, package.
    #[inline(always)]
    pub(crate) fn take(&mut self, slots: &Slots<'_>) -> Option<Taken> {
        self.receives = self.receives.wrapping_add(1);
        if self.receives.is_multiple_of(RESCAN_EVERY) {
            self.defer((self.receives / RESCAN_EVERY) as usize % slots.count());
        }
        let mut known = self.knows_the_first(slots);
        // Each turn but the last drops an entry because its package was displaced or replaced since it was seen. That
        // is tried as often as there are slots, and not forever.
        for _ in 0..=slots.count() {
            if !known {
                self.look_for_the_first(slots);
            }
            let (seen, slot) = self.pop()?;
            if let Some(taken) = slots.take(slot, seen) {
                return Some(taken);
            }
            // The slot's next sender hints again; and what took its place may stand before all others.
            known = false;
        }
        // So much bad luck in a row: something that waits, then, though perhaps not the first.
        while let Some((seen, slot)) = self.pop() {
            if let Some(taken) = slots.take(slot, seen) {
                return Some(taken);
            }
        }
        None
    }

    /// Whether the first of the heap is the first of all: nobody has alerted, and it is of the level or above.
    #[inline(always)]
    fn knows_the_first(&self, slots: &Slots<'_>) -> bool {
        let first = self.heap.first();
        first.is_some_and(|(word, _)| u16::from(word.priority().0) >= self.level) && !slots.is_alerted()
    }

    /// Looks at the hints, and tells senders of what priority the first is, if that is another than before.
    fn look_for_the_first(&mut self, slots: &Slots<'_>) {
        if slots.is_alerted() {
            slots.heed();
        }
        self.look(slots);
        if let Some(first) = self.first()
            && u16::from(first.0) < self.level
        {
            slots.lower_level(first);
            self.level = first.0.into();
            self.look(slots);
        }
        if let Some(first) = self.first()
            && u16::from(first.0) > self.level
        {
            slots.raise_level(first);
            self.level = first.0.into();
        }
    }

    /// Priority of the first that is known.
    pub(crate) fn first(&self) -> Option<Priority> {
        self.heap.first().map(|(word, _)| word.priority())
    }

    /// Treats every slot as hinted at the next look: after adoption, and when somebody died.
    pub(crate) fn rescan(&mut self, slots: &Slots<'_>) {
        (0..slots.count()).for_each(|slot| self.defer(slot));
    }

    /// Looks before it takes the next: somebody died, perhaps before it alerted.
    pub(crate) fn doubt(&mut self) {
        self.level = NO_LEVEL;
    }

    fn defer(&mut self, slot: usize) {
        self.deferred[slot / 64] |= 1 << (slot % 64);
    }

    /// Moves what the hints speak of into the heap: with a package all that its sender published before it.
    pub(crate) fn look(&mut self, slots: &Slots<'_>) {
        self.collect(slots, u64::MAX);
        // ORDERING: the words were read with Acquire. The sender that published one of them had hinted its earlier ones
        // before; those hints were among the swapped ones, or are seen here.
        if !slots.any_hint() {
            return;
        }
        // Senders are quick, and going on until nothing new comes would have no bound. Of what comes now, only what was
        // published before this. ORDERING: Acquire; pairs with the fetch_add of `publish`: all that a sender hinted
        // before its package T is seen below.
        let horizon = slots.hot.ticket.0.load(Ordering::Acquire);
        self.collect(slots, horizon);
    }

    #[inline(always)]
    fn collect(&mut self, slots: &Slots<'_>, horizon: u64) {
        for (i, hints) in slots.hot.ready.0[..slots.count().div_ceil(64)].iter().enumerate() {
            // Looked at before it is swapped, so that a hint word without hints is not written. SeqCst for (J): the
            // look after the level sank.
            let fresh = if hints.load(Ordering::SeqCst) == 0 { 0 } else { hints.swap(0, Ordering::AcqRel) };
            let mut bits = fresh | std::mem::take(&mut self.deferred[i]);
            while bits != 0 {
                let slot = i * 64 + bits.trailing_zeros() as usize;
                // Whatever another process wrote there.
                if slot >= slots.count() {
                    break;
                }
                bits &= bits - 1;
                slots.expect_package(slot);
                let word = slots.load(slot);
                if !word.is_ready() {
                    continue;
                }
                if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }
            }
        }
    }

    #[inline]
    fn insert(&mut self, word: Word, slot: usize) {
        // Mostly the receiver keeps up, and knows of one package at a time.
        if self.heap.is_empty() {
            self.heap.push((word, slot as u16));
            self.place[slot] = 0;
            return;
        }
        self.insert_among(word, slot);
    }

    #[inline(never)]
    fn insert_among(&mut self, word: Word, slot: usize) {
        let at = match self.place[slot] {
            ABSENT => {
                self.heap.push((word, slot as u16));
                self.heap.len() - 1
            }
            at => {
                self.heap[at as usize].0 = word;
                at as usize
            }
        };
        let at = self.rise(at);
        self.sink(at);
    }

    #[inline]
    fn pop(&mut self) -> Option<(Word, usize)> {
        let (last, last_slot) = self.heap.pop()?;
        let (word, slot) = match self.heap.first_mut() {
            None => (last, last_slot),
            Some(first) => {
                let first = std::mem::replace(first, (last, last_slot));
                self.sink(0);
                first
            }
        };
        self.place[usize::from(slot)] = ABSENT;
        Some((word, slot.into()))
    }

    fn rise(&mut self, mut at: usize) -> usize {
        while at > 0 && self.heap[(at - 1) / 2].0.rank() < self.heap[at].0.rank() {
            self.heap.swap(at, (at - 1) / 2);
            self.settle(at);
            at = (at - 1) / 2;
        }
        self.settle(at);
        at
    }

    #[inline(never)]
    fn sink(&mut self, mut at: usize) {
        loop {
            let rank = |at: usize| self.heap.get(at).map_or(0, |(word, _)| word.rank());
            let (left, right) = (2 * at + 1, 2 * at + 2);
            let child = if rank(right) > rank(left) { right } else { left };
            if child >= self.heap.len() || rank(child) <= rank(at) {
                break;
            }
            self.heap.swap(at, child);
            self.settle(at);
            at = child;
        }
        self.settle(at);
    }

    fn settle(&mut self, at: usize) {
        if let Some((_, slot)) = self.heap.get(at) {
            self.place[*slot as usize] = at as u16;
        }
    }
}
