//! What a replica leaves out of its ring: sequences of records that never come, each with its cause.
//!
//! ```text
//!  sequence      6       7        8         9         10
//!  entry      record    lost   sampled   sampled    record
//!  before:       -       -      1 lost    1 lost     1 lost
//!                                        1 sampled  2 sampled
//! ```
//!
//! Each entry says how many were left out before it since the ring began, for each cause. So two entries say exactly
//! what is between them, though the ring does not keep it any more.

use crate::stream::omission::{LeftOut, OmissionCause};
use crate::stream::ring::{IndexEntry, LEFT_OUT, Look, Ring, Stamp, word};
use crate::sync::{Ordering, fence};

/// The entry of a sequence that was left out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Omission {
    /// What the stream had reached.
    pub(crate) reached: Stamp,
    pub(crate) cause: OmissionCause,
    /// What was left out before it.
    pub(crate) before: LeftOut,
}

impl IndexEntry {
    /// What stands for the length of a record in the entry of one that was left out.
    pub(super) fn len_of(cause: OmissionCause) -> u64 {
        match cause {
            OmissionCause::Lost => 0,
            OmissionCause::Sampled => 1,
        }
    }
}

impl Ring<'_> {
    /// What there is of a sequence that was left out; none: it was not, or a newer one has its place.
    /// ORDERING: Acquire (B), then (D), as in `look`.
    pub(crate) fn left_out(&self, sequence: u64) -> Option<Omission> {
        let (entry, expected) = (self.entry(sequence), word(sequence, Some(LEFT_OUT)));
        if entry.word.load(Ordering::Acquire) != expected || self.frames() > LEFT_OUT {
            return None;
        }
        let about = entry.about();
        fence(Ordering::Acquire);
        let is_sampled = about.len_bytes == IndexEntry::len_of(OmissionCause::Sampled);
        let omission = Omission {
            reached: Stamp { ns: about.before_ns, ..about.stamp },
            cause: if is_sampled { OmissionCause::Sampled } else { OmissionCause::Lost },
            before: about.left_out,
        };
        (entry.word.load(Ordering::Relaxed) == expected).then_some(omission)
    }

    /// What was left out before this sequence, as its entry says; none: that says nothing of it.
    pub(crate) fn left_out_before(&self, sequence: u64) -> Option<LeftOut> {
        match self.look(sequence) {
            Look::There(line) => Some(line.about.left_out),
            Look::NotYet | Look::Gone => self.left_out(sequence).map(|omission| omission.before),
        }
    }

    /// What was left out up to this sequence, as its entry says; none: that says nothing of it.
    pub(crate) fn left_out_up_to(&self, sequence: u64) -> Option<LeftOut> {
        match self.look(sequence) {
            Look::There(line) => Some(line.about.left_out),
            Look::NotYet | Look::Gone => self.left_out(sequence).map(|omission| omission.before.with(omission.cause)),
        }
    }
}
