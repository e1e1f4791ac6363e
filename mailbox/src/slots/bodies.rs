//! Where the slots' prefixes and bodies lie, so that their cache lines can be prefetched. Nothing here reads them.

use crate::sync::{prefetch_to_read, prefetch_to_write};

#[derive(Clone, Copy)]
pub(crate) struct Bodies {
    pub(crate) first: *const u8,
    /// From one slot's to the next.
    pub(crate) bytes: usize,
    /// Number of the segment in this process: claims and taken packages are of one segment, and of no use in another.
    pub(crate) segment: u64,
}

impl Bodies {
    /// Prefetches the cache lines that the next filler of the slot writes first.
    pub(crate) fn expect_to_fill(&self, slot: usize) {
        self.first_lines(slot).into_iter().for_each(prefetch_to_write);
    }

    /// Prefetches the cache lines of a package, all at once, before they are looked at.
    pub(crate) fn expect_package(&self, slot: usize) {
        self.first_lines(slot).into_iter().for_each(prefetch_to_read);
    }

    /// The second is the first once more if the slot has no other.
    fn first_lines(&self, slot: usize) -> [*const u8; 2] {
        let second = if self.bytes > 64 { 64 } else { 0 };
        [0, second].map(|line| self.first.wrapping_add(slot * self.bytes + line))
    }
}
