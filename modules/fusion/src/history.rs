//! The newest records of a stream, in the memory of one process.

use crate::lookup::Records;
use crate::record::{Record, Refused, Stamp};
use crate::sorted::Sorted;
use std::ops::Range;

/// A bounded history of stamped values, asked by time through [`Records`]. When it is full, the oldest record leaves.
///
/// ```
/// use rohrpost_fusion::{History, NoValue, Records, Stamp};
/// let mut reach_m = History::new(100, 0);
/// reach_m.push(Stamp::new(1, 1_000), 0, 0.0)?;
/// reach_m.push(Stamp::new(1, 2_000), 1, 1.0)?;
/// assert_eq!(reach_m.at(Stamp::new(1, 1_500), 5_000), Ok(0.5));
/// assert_eq!(reach_m.at(Stamp::new(1, 1_500), 500), Err(NoValue::Gap { gap_ns: 1_000, gap_max_ns: 500 }));
/// assert_eq!(reach_m.at(Stamp::new(1, 2_001), 5_000), Err(NoValue::NotYet { by_ns: 1 }));
/// # Ok::<(), rohrpost_fusion::Refused>(())
/// ```
#[derive(Clone, Debug)]
pub struct History<V> {
    sorted: Sorted<V>,
}

impl<V> History<V> {
    /// Keeps this many records, two at least; all memory is taken now. Records may come less than `lateness_ns` behind
    /// the newest one; with 0, stamps must not go back.
    pub fn new(capacity: usize, lateness_ns: u64) -> Self {
        Self { sorted: Sorted::new(capacity.max(2), lateness_ns) }
    }

    /// Takes a record. With the first one of a later epoch, those of the earlier epoch are forgotten.
    pub fn push(&mut self, stamp: Stamp, sequence: u64, value: V) -> Result<(), Refused> {
        if self.sorted.newest_stamp().is_some_and(|newest| stamp.epoch > newest.epoch) {
            self.sorted.clear();
        }
        self.sorted.insert(Record { stamp, sequence, value }).map(drop)
    }

    /// The record with the latest stamp.
    pub fn newest(&self) -> Option<&Record<V>> {
        self.record(self.positions().end.checked_sub(1)?)
    }

    /// The record at a position; none if there is none.
    pub fn record(&self, position: u64) -> Option<&Record<V>> {
        self.sorted.get(usize::try_from(position).ok()?)
    }

    /// From the oldest record to behind the newest.
    pub fn positions(&self) -> Range<u64> {
        0..self.sorted.len() as u64
    }
}

impl<V: Clone> Records for History<V> {
    type Value = V;

    fn epoch(&self) -> Option<u64> {
        self.sorted.newest_stamp().map(|newest| newest.epoch)
    }

    fn lateness_ns(&self) -> u64 {
        self.sorted.lateness_ns()
    }

    fn positions(&self) -> Range<u64> {
        self.positions()
    }

    fn stamp_ns(&self, position: u64) -> Option<u64> {
        self.record(position).map(|record| record.stamp.ns)
    }

    fn read(&self, position: u64) -> Option<V> {
        self.record(position).map(|record| record.value.clone())
    }
}
