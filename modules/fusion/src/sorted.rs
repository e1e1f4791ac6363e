//! Records of one stream in the order of their stamps, whatever the order they come in.
//!
//! ```text
//!   oldest ─────────────── settled │ still open ─────────── newest
//!   nothing comes in between here  │ ◀──── lateness bound ────▶
//! ```

use crate::record::{Record, Refused, Stamp};
use std::collections::VecDeque;

/// What is known of a place in the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// A settled record has this stamp.
    Settled(Stamp),
    /// No record that comes here has an earlier stamp.
    NotBefore(Stamp),
    /// Nothing was put in yet.
    Unknown,
}

#[derive(Clone, Debug)]
pub(crate) struct Sorted<V> {
    records: VecDeque<Record<V>>,
    capacity: usize,
    lateness_ns: u64,
    /// Stamp and number of the newest record ever taken; it may have been removed since.
    newest: Option<(Stamp, u64)>,
}

impl<V> Sorted<V> {
    /// All memory is taken now.
    pub(crate) fn new(capacity: usize, lateness_ns: u64) -> Self {
        Self { records: VecDeque::with_capacity(capacity), capacity, lateness_ns, newest: None }
    }

    /// Puts a record where its stamp belongs. If there is no room, the oldest leaves, which may be the record itself.
    pub(crate) fn insert(&mut self, record: Record<V>) -> Result<Option<Record<V>>, Refused> {
        let key = (record.stamp, record.sequence);
        self.admit(key.0, key.1)?;
        let mut at = self.records.partition_point(|known| (known.stamp, known.sequence) < key);
        if self.records.get(at).is_some_and(|known| (known.stamp, known.sequence) == key) {
            return Err(Refused::Repeated { sequence: key.1, known: key.1 });
        }
        self.newest = self.newest.max(Some(key));
        let mut left = None;
        if self.records.len() == self.capacity {
            if at == 0 {
                return Ok(Some(record));
            }
            left = self.records.pop_front();
            at -= 1;
        }
        self.records.insert(at, record);
        Ok(left)
    }

    /// Whether answers so far could not depend on this record.
    fn admit(&self, stamp: Stamp, sequence: u64) -> Result<(), Refused> {
        let Some((newest, known)) = self.newest else { return Ok(()) };
        if stamp.epoch < newest.epoch {
            return Err(Refused::EarlierEpoch { epoch: stamp.epoch, newest: newest.epoch });
        }
        let Some(by_ns) = newest.since(stamp) else { return Ok(()) };
        if by_ns > 0 && by_ns >= self.lateness_ns {
            return Err(Refused::Late { by_ns, lateness_ns: self.lateness_ns });
        }
        // Without lateness the newest record is settled at once, and only a later one may have its stamp.
        if by_ns == 0 && self.lateness_ns == 0 && sequence <= known {
            return Err(Refused::Repeated { sequence, known });
        }
        Ok(())
    }

    /// Whether no record comes any more that would stand at this time or before it.
    fn is_settled(&self, stamp: Stamp) -> bool {
        let Some((newest, _)) = self.newest else { return false };
        stamp.epoch < newest.epoch || newest.since(stamp).is_some_and(|by_ns| by_ns >= self.lateness_ns)
    }

    /// What is known of the record at an index from the oldest.
    pub(crate) fn place(&self, index: usize) -> Place {
        match (self.records.get(index), self.newest) {
            (Some(record), _) if self.is_settled(record.stamp) => Place::Settled(record.stamp),
            (_, Some((newest, _))) => {
                Place::NotBefore(Stamp { ns: newest.ns.saturating_sub(self.lateness_ns), ..newest })
            }
            (_, None) => Place::Unknown,
        }
    }

    pub(crate) fn newest_stamp(&self) -> Option<Stamp> {
        self.newest.map(|(stamp, _)| stamp)
    }

    pub(crate) fn lateness_ns(&self) -> u64 {
        self.lateness_ns
    }

    pub(crate) fn len(&self) -> usize {
        self.records.len()
    }

    pub(crate) fn get(&self, index: usize) -> Option<&Record<V>> {
        self.records.get(index)
    }

    pub(crate) fn pop_oldest(&mut self) -> Option<Record<V>> {
        self.records.pop_front()
    }

    /// Removes the records, and remembers which was the newest.
    pub(crate) fn clear(&mut self) {
        self.records.clear();
    }
}
