//! The receiver's private view of a mailbox: which ready slot comes first.
//!
//! Holds hints only, one entry a slot: the word is asked again, by compare-and-swap, when a package is taken. Everything
//! is allocated at the start.

use crate::slots::{HINT_WORDS, Slots, Taken};
use crate::sync::Ordering;
use crate::word::Word;

/// Every so many receives one word in turn is looked at without a hint: a sender may have died between publishing and
/// setting it.
const RESCAN_EVERY: u32 = 16;
const ABSENT: u16 = u16::MAX;

/// A binary heap of the ready slots that are known, and the hints that must wait for the next look.
pub(crate) struct Queue {
    /// Greatest rank first. Each entry: the word as it was seen, and its slot.
    heap: Vec<(Word, u16)>,
    /// Where in the heap a slot stands.
    place: Vec<u16>,
    /// Slots seen with a ticket younger than the look: they stay for the next one, else a sender's second package could
    /// pass its first.
    deferred: [u64; HINT_WORDS],
    receives: u32,
}

impl Queue {
    pub(crate) fn new(count: usize) -> Self {
        Self { heap: Vec::with_capacity(count), place: vec![ABSENT; count], deferred: [0; HINT_WORDS], receives: 0 }
    }

    /// Packages known to wait.
    pub(crate) fn len(&self) -> usize {
        self.heap.len()
    }

    /// Whether something may wait that has not been looked at.
    pub(crate) fn may_have_more(&self, slots: &Slots<'_>) -> bool {
        !self.heap.is_empty() || self.deferred.iter().any(|bits| *bits != 0) || slots.any_hint()
    }

    /// Takes the most important, then earliest, package.
    pub(crate) fn take(&mut self, slots: &Slots<'_>) -> Option<Taken> {
        self.receives = self.receives.wrapping_add(1);
        if self.receives.is_multiple_of(RESCAN_EVERY) {
            self.defer((self.receives / RESCAN_EVERY) as usize % slots.count());
        }
        // One more look only if nothing of the first was old enough; going on until nothing new comes would have no bound.
        for _ in 0..2 {
            self.look(slots);
            while let Some((seen, slot)) = self.pop() {
                // Displaced since it was seen: the entry is dropped; whoever fills the slot hints again.
                if let Some(taken) = slots.take(slot, seen) {
                    return Some(taken);
                }
            }
            if !self.may_have_more(slots) {
                return None;
            }
        }
        None
    }

    /// Treats every slot as hinted at the next look: after adoption, and when somebody died.
    pub(crate) fn rescan(&mut self, slots: &Slots<'_>) {
        (0..slots.count()).for_each(|slot| self.defer(slot));
    }

    fn defer(&mut self, slot: usize) {
        self.deferred[slot / 64] |= 1 << (slot % 64);
    }

    /// Moves what the hints speak of into the heap.
    pub(crate) fn look(&mut self, slots: &Slots<'_>) {
        // ORDERING: Acquire; pairs with the fetch_add of `publish`: all that a sender hinted before its package T is seen below.
        let horizon = slots.hot.ticket.load(Ordering::Acquire);
        for i in 0..slots.count().div_ceil(64) {
            let hints = &slots.hot.ready[i];
            // Looked at before it is swapped, so that an idle line stays shared.
            let fresh = if hints.load(Ordering::Relaxed) == 0 { 0 } else { hints.swap(0, Ordering::AcqRel) };
            let mut bits = fresh | std::mem::take(&mut self.deferred[i]);
            while bits != 0 {
                let slot = i * 64 + bits.trailing_zeros() as usize;
                // Whatever another process wrote there.
                if slot >= slots.count() {
                    break;
                }
                bits &= bits - 1;
                let word = slots.load(slot);
                if !word.is_ready() {
                    continue;
                }
                if word.ticket() < horizon { self.insert(word, slot) } else { self.defer(slot) }
            }
        }
    }

    fn insert(&mut self, word: Word, slot: usize) {
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

    fn pop(&mut self) -> Option<(Word, usize)> {
        if self.heap.is_empty() {
            return None;
        }
        let (word, slot) = self.heap.swap_remove(0);
        self.place[slot as usize] = ABSENT;
        self.sink(0);
        Some((word, slot as usize))
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

    fn sink(&mut self, mut at: usize) {
        loop {
            let children = [2 * at + 1, 2 * at + 2].into_iter().filter(|child| *child < self.heap.len());
            let Some(child) = children.max_by_key(|child| self.heap[*child].0.rank()) else { break };
            if self.heap[child].0.rank() <= self.heap[at].0.rank() {
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
