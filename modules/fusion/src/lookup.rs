//! The value of a stream at a time, or exactly why there is none.

use crate::interpolate::{Interpolate, Share};
use crate::record::Stamp;
use std::ops::Range;
use thiserror::Error;

/// Why a stream has no value for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoValue {
    /// There is no record yet.
    #[error("no record is known yet")]
    Empty,
    /// All records are younger: it has left the memory, or was never there. Asking again does not help.
    #[error("{by_ns} ns before the oldest record that is kept")]
    BeforeOldest {
        /// From the time asked for to the oldest record.
        by_ns: u64,
    },
    /// A record that decides may still come. Ask again after the next one.
    #[error("not known yet: the newest record must be at least {by_ns} ns younger")]
    NotYet {
        /// How far the newest stamp must go on at least.
        by_ns: u64,
    },
    /// The records around that time are too far apart to know what was in between.
    #[error("it lies in a gap of {gap_ns} ns; at most {gap_max_ns} ns are bridged")]
    Gap {
        /// From the record before to the one after.
        gap_ns: u64,
        /// The limit.
        gap_max_ns: u64,
    },
    /// Time was set in between.
    #[error("it is of epoch {asked}, the records are of epoch {known}")]
    OtherEpoch {
        /// Epoch of the time asked for.
        asked: u64,
        /// Epoch of the records.
        known: u64,
    },
}

/// The records around a time, by their positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Around {
    /// A record has this very stamp; of several it is the newest.
    At(u64),
    /// The records with the nearest stamps before and after that time; of several with one stamp the newest.
    Between {
        /// Position of the one before.
        before: u64,
        /// Position of the one after.
        after: u64,
        /// How much of the time between them has gone by.
        share: Share,
    },
}

/// Records of one stream and one epoch in the order of their stamps. What is no longer there when it is asked for
/// counts as forgotten, so a view of memory that a writer goes on with can be asked too.
pub trait Records {
    /// What a record holds.
    type Value;

    /// Epoch of the records; none if nothing was written yet.
    fn epoch(&self) -> Option<u64>;

    /// How far behind the newest record another one may still come: less than this.
    fn lateness_ns(&self) -> u64;

    /// From the position of the oldest record to behind that of the newest.
    fn positions(&self) -> Range<u64>;

    /// Stamp of the record at a position; none if it is forgotten.
    fn stamp_ns(&self, position: u64) -> Option<u64>;

    /// Value of the record at a position; none if it is forgotten.
    fn read(&self, position: u64) -> Option<Self::Value>;

    /// The records around a time, if they are at most `gap_max_ns` apart, and no record that may still come could
    /// stand between them.
    fn around(&self, stamp: Stamp, gap_max_ns: u64) -> Result<Around, NoValue> {
        let positions = self.positions();
        let newest_ns = positions.end.checked_sub(1).and_then(|newest| self.stamp_ns(newest));
        let (Some(known), Some(newest_ns)) = (self.epoch(), newest_ns) else { return Err(NoValue::Empty) };
        if stamp.epoch != known {
            return Err(NoValue::OtherEpoch { asked: stamp.epoch, known });
        }
        let settled = |ns: u64| match ns.saturating_add(self.lateness_ns()).saturating_sub(newest_ns) {
            0 => Ok(()),
            by_ns => Err(NoValue::NotYet { by_ns }),
        };
        let after = first_from(self, positions.clone(), stamp.ns);
        if after == positions.end {
            // Younger than the newest record, by 1 ns at least.
            return Err(NoValue::NotYet { by_ns: (stamp.ns - newest_ns).saturating_add(self.lateness_ns()) });
        }
        let Some(after_ns) = self.stamp_ns(after) else { return Err(forgotten(self, stamp.ns)) };
        // Until then, a record may come that stands before this one.
        settled(after_ns)?;
        let newest_of_after = || match self.stamp_ns(after + 1) {
            Some(next_ns) if next_ns == after_ns => {
                first_from(self, after + 1..positions.end, after_ns.saturating_add(1)) - 1
            }
            _ => after,
        };
        if after_ns == stamp.ns {
            return Ok(Around::At(newest_of_after()));
        }
        let before = after.checked_sub(1).filter(|before| positions.contains(before));
        let Some(before) = before else { return Err(NoValue::BeforeOldest { by_ns: after_ns - stamp.ns }) };
        let Some(before_ns) = self.stamp_ns(before) else { return Err(forgotten(self, stamp.ns)) };
        let gap_ns = after_ns.saturating_sub(before_ns);
        if gap_ns > gap_max_ns {
            return Err(NoValue::Gap { gap_ns, gap_max_ns });
        }
        let share = Share::between(before_ns, stamp.ns, after_ns).ok_or_else(|| forgotten(self, stamp.ns))?;
        Ok(Around::Between { before, after: newest_of_after(), share })
    }

    /// The value at a time: that of the record with this stamp, or interpolated between the two around it.
    fn at(&self, stamp: Stamp, gap_max_ns: u64) -> Result<Self::Value, NoValue>
    where
        Self::Value: Interpolate,
    {
        let found = match self.around(stamp, gap_max_ns)? {
            Around::At(position) => self.read(position),
            Around::Between { before, after, share } => match (self.read(before), self.read(after)) {
                (Some(from), Some(to)) => Some(Interpolate::interpolate(&from, &to, share)),
                _ => None,
            },
        };
        found.ok_or_else(|| forgotten(self, stamp.ns))
    }
}

/// Position of the first record with this stamp or a later one.
fn first_from<R: Records + ?Sized>(records: &R, positions: Range<u64>, stamp_ns: u64) -> u64 {
    let Range { mut start, mut end } = positions;
    while start < end {
        let middle = start + (end - start) / 2;
        // What is forgotten is older than what is kept.
        if records.stamp_ns(middle).is_none_or(|ns| ns < stamp_ns) {
            start = middle + 1;
        } else {
            end = middle;
        }
    }
    start
}

/// The answer if a record was forgotten while it was looked for.
fn forgotten<R: Records + ?Sized>(records: &R, stamp_ns: u64) -> NoValue {
    let oldest_ns = records.stamp_ns(records.positions().start);
    oldest_ns.map_or(NoValue::Empty, |oldest_ns| NoValue::BeforeOldest { by_ns: oldest_ns.saturating_sub(stamp_ns) })
}
