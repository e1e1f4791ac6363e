//! Single-writer cells: one writer changes a few atomic words, and any number of readers, in any process, see them
//! whole.
//!
//! | type | the words exist | a write costs, besides the words | a writer that dies in the middle leaves |
//! | --- | --- | --- | --- |
//! | [`SeqCount`] | once, changed in place | two stores | nothing to read, until a successor writes all words |
//! | [`SeqLatch`] | twice, in two places | one store | the previous value |
//!
//! These are `seqcount_t` and `seqcount_latch_t` of the Linux kernel. The words are the caller's, all of them atomics,
//! so that a read that races with a write is no undefined behaviour; the caller loads and stores them Relaxed. A write
//! takes a bounded number of steps and waits for nobody. A read never waits: it gives up when a write is in its way.
//!
//! The caller decides which writer is the one: by a lock, a claim or a single thread. Nothing here maps memory or
//! sleeps, so that loom checks this file as it is.

use crate::step::step;
use crate::sync::{AtomicU32, AtomicU64, Ordering, fence};

/// Guards words that are changed in place. Odd while the writer is inside, or if it died inside.
///
/// ```
/// use rohrpost_mailbox::SeqCount;
/// use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
///
/// let (count, words) = (SeqCount::default(), [AtomicU64::new(0), AtomicU64::new(0)]);
/// count.write(|| words.iter().for_each(|word| word.store(7, Relaxed)));
/// let read = count.read(|| words.each_ref().map(|word| word.load(Relaxed)));
/// assert_eq!(read, Some((count.version(), [7, 7])));
/// // A read that overlaps a write gets nothing.
/// count.write(|| assert_eq!(count.read(|| ()), None));
/// ```
#[derive(Debug, Default)]
#[repr(transparent)]
pub struct SeqCount(AtomicU32);

impl SeqCount {
    /// Changes the words; readers see all of the change or none. For the one writer alone. A successor of a writer that
    /// died inside must store all words.
    #[inline]
    pub fn write(&self, change: impl FnOnce()) {
        // Already odd if the last writer died inside.
        let inside = self.0.load(Ordering::Relaxed) | 1;
        self.0.store(inside, Ordering::Relaxed);
        // ORDERING (A): a reader that sees a new word sees the odd number, or a later one. Pairs with (B).
        fence(Ordering::Release);
        step!("cell: inside");
        change();
        // ORDERING (C): a reader that sees the even number sees all words. Pairs with (D).
        self.0.store(inside.wrapping_add(1), Ordering::Release);
    }

    /// What `look` returns, and the version that it saw. None while the writer is inside, or if it died inside: the
    /// caller keeps what it had, or tries again a bounded number of times.
    #[inline]
    pub fn read<T>(&self, look: impl FnOnce() -> T) -> Option<(u32, T)> {
        // ORDERING: Acquire (D); pairs with (C).
        let version = self.0.load(Ordering::Acquire);
        if !version.is_multiple_of(2) {
            return None;
        }
        let seen = look();
        // ORDERING (B): the words before the second look at the number. Pairs with (A).
        fence(Ordering::Acquire);
        (self.0.load(Ordering::Relaxed) == version).then_some((version, seen))
    }

    /// Changes with each write. Says whether a read would find anything new; orders nothing. 0: nothing was written
    /// yet.
    #[inline]
    pub fn version(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Says which of two places has the valid value: place `index % 2`, where the index counts the values. 0: none yet. The
/// writer fills the other place, then publishes it.
#[derive(Debug, Default)]
#[repr(transparent)]
pub(crate) struct SeqLatch(AtomicU64);

impl SeqLatch {
    /// The index of the next value, never 0. Only what a foreign program wrote here wraps.
    fn next(&self) -> u64 {
        match self.0.load(Ordering::Relaxed) {
            // Even, so that it is the other place.
            u64::MAX => 2,
            index => index + 1,
        }
    }

    /// Fills the place that is not valid; readers do not see it yet. For the one writer alone. May be repeated before
    /// [`SeqLatch::publish`], and must store all words.
    pub(crate) fn fill(&self, store: impl FnOnce(usize)) {
        let next = self.next();
        // ORDERING (E): the index of the last value before the words of this one: a reader of the place that is filled
        // now sees that the index has changed. Pairs with (F).
        fence(Ordering::Release);
        store((next % 2) as usize);
    }

    /// Makes the place just filled the valid one.
    pub(crate) fn publish(&self) {
        let next = self.next();
        // ORDERING: Release (G); pairs with (H).
        self.0.store(next, Ordering::Release);
        step!("cell: published");
    }

    /// What `look` returns for the valid place. None before the first value, or if the writer published twice during
    /// each of so many tries.
    pub(crate) fn read<T>(&self, tries: usize, look: impl Fn(usize) -> T) -> Option<T> {
        for _ in 0..tries {
            // ORDERING: Acquire (H); pairs with (G): the value that the index names is whole.
            let index = self.0.load(Ordering::Acquire);
            if index == 0 {
                return None;
            }
            let seen = look((index % 2) as usize);
            // ORDERING (F): the words before the second look at the index. Pairs with (E): as long as the index stays,
            // the writer is at most in the other place.
            fence(Ordering::Acquire);
            if self.0.load(Ordering::Relaxed) == index {
                return Some(seen);
            }
        }
        None
    }
}
