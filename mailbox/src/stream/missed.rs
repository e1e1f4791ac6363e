//! What a reader did not get, and why.

use crate::stream::omission::{LeftOut, OmissionCause};
use crate::stream::ring::Ring;
use crate::sync::Ordering;

/// Records that were not read, by cause; each number counts records.
///
/// Only a replica leaves records out of its ring, so beside the writer the first two are 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Missed {
    /// Lost on the way from the node that writes the stream: parts of them never came, or the wire was too slow.
    pub lost: u64,
    /// Left out by the sampling of the replica: `every`, `rate` or `changed` in its configuration.
    pub sampled: u64,
    /// Overwritten in the ring of this node before they were read.
    pub passed_over: u64,
}

impl Missed {
    /// All causes together.
    pub fn all(&self) -> u64 {
        self.lost.saturating_add(self.sampled).saturating_add(self.passed_over)
    }

    /// What came to it since it was `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            lost: self.lost.saturating_sub(before.lost),
            sampled: self.sampled.saturating_sub(before.sampled),
            passed_over: self.passed_over.saturating_sub(before.passed_over),
        }
    }
}

/// A reader's account of what it missed. Whatever a damaged file says, each record that it missed has one cause.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MissedAccount {
    missed: Missed,
    /// Missed as well, and the entry behind them could not be seen yet.
    unexplained: u64,
    /// What was left out before these; none: not known.
    known: Option<LeftOut>,
}

impl MissedAccount {
    pub(crate) fn missed(&self) -> Missed {
        self.missed
    }

    /// The reader goes on from this sequence, whatever was before.
    pub(crate) fn begin(&mut self, ring: &Ring<'_>, sequence: u64) {
        // Nothing says more of them.
        self.missed.passed_over = self.missed.passed_over.saturating_add(std::mem::take(&mut self.unexplained));
        let is_first = sequence <= ring.first();
        let before = || ring.left_out_before(sequence).or_else(|| ring.left_out_up_to(sequence.checked_sub(1)?));
        self.known = if is_first { Some(LeftOut::default()) } else { before() };
    }

    /// The reader comes to an entry which says that so many were left out before it.
    #[inline]
    pub(crate) fn come_to(&mut self, before: LeftOut) {
        if self.unexplained > 0 {
            self.explain(before);
        }
        self.known = Some(before);
    }

    #[cold]
    fn explain(&mut self, before: LeftOut) {
        let known = self.known.unwrap_or(before);
        let gap = std::mem::take(&mut self.unexplained);
        let lost = before.lost.saturating_sub(known.lost).min(gap);
        let sampled = before.sampled.saturating_sub(known.sampled).min(gap - lost);
        let missed = &mut self.missed;
        missed.lost = missed.lost.saturating_add(lost);
        missed.sampled = missed.sampled.saturating_add(sampled);
        missed.passed_over = missed.passed_over.saturating_add(gap - lost - sampled);
    }

    /// The record of this sequence is gone: where the reader of a seat goes on.
    #[cold]
    pub(crate) fn miss(&mut self, ring: &Ring<'_>, seat: usize, gone: u64) -> u64 {
        if let Some(omission) = ring.left_out(gone) {
            self.come_to(omission.before);
            self.known = Some(omission.before.with(omission.cause));
            let of_cause = match omission.cause {
                OmissionCause::Lost => &mut self.missed.lost,
                OmissionCause::Sampled => &mut self.missed.sampled,
            };
            *of_cause = of_cause.saturating_add(1);
            return gone + 1;
        }
        let oldest = ring.oldest_after(gone);
        self.unexplained = self.unexplained.saturating_add(oldest - gone);
        if let Some(before) = ring.left_out_before(oldest) {
            self.come_to(before);
        }
        // For tools alone, which look at one number.
        ring.seats()[seat].passed_over.store(self.missed.passed_over, Ordering::Relaxed);
        oldest
    }
}
