//! Sets of records of several streams that belong together, decided by their stamps alone.
//!
//! ```text
//!  image  ───a────────────b────────────c───────▶ time
//!  scan   ─────1──2──3──4──5──6──7──8──9──10───▶
//!  sets      {a, 1}     {b, 5}       {c, 9}         each of the least size; 2, 3, 4, 6, 7, 8 are passed over
//! ```
//!
//! The *size* of a set is the time from its earliest to its latest record; it is at most the tolerance. What holds, by
//! the names that ROS's `message_filters` gives it for `ApproximateTime`:
//!
//! 1. Each record is in one set at most.
//! 2. Sets do not cross: of two, one is the earlier one on each stream.
//! 3. Sets are contiguous: of what was dropped between two sets, no set within the tolerance can be formed.
//! 4. A set has the least size of all that are contiguous to the set before; of several, it is the one that ends first,
//!    and in it each stream's record is the earliest.
//! 5. Sets depend on stamps and numbers of records, not on the order in which they come, as long as they come within
//!    their stream's lateness bound and there is room for what must wait.
//!
//! **How.** Each stream shows its settled records in order. The first one of a stream is *alone* if another stream's
//! first one is more than the tolerance younger: what comes later is younger still. When no first one is alone, they
//! are a set. The latest of them, the *pivot*, is in a set of the least size: to replace it by a later record of its
//! stream can only move the end away. So the search replaces the earliest record by the next one of its stream, again
//! and again, until that would pass the pivot.

use crate::record::{Record, Refused, Stamp};
use crate::sorted::{Place, Sorted};
use std::array;

/// A stream that a matcher joins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatchInput {
    /// Its name, for people.
    pub name: String,
    /// How far behind the newest record another one may come: less than this. With 0, stamps must not go back.
    pub lateness_ns: u64,
    /// Records that can wait for those of other streams, one at least.
    pub capacity: usize,
}

/// What became of a stream's records. Their sum, without `pushed`, and what waits is `pushed`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MatchCounts {
    /// Records that came.
    pub pushed: u64,
    /// In a set.
    pub matched: u64,
    /// Another stream has no record within the tolerance.
    pub alone: u64,
    /// A set of less size was formed without it.
    pub passed_over: u64,
    /// It was the oldest when the stream's memory was full.
    pub no_room: u64,
    /// Not taken: behind the newest record by the lateness bound or more.
    pub late: u64,
    /// Not taken: the stream had gone on to a later epoch.
    pub earlier_epoch: u64,
    /// Not taken: its stamp and number were known.
    pub repeated: u64,
}

/// The stream that the next set waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Missing<'m> {
    /// Which one.
    pub stream: usize,
    /// Its name.
    pub name: &'m str,
    /// From its newest record to the newest one of all streams; none if it has no record of that epoch.
    pub behind_ns: Option<u64>,
}

struct Lane<V> {
    name: String,
    sorted: Sorted<V>,
    counts: MatchCounts,
}

/// Joins `N` streams, two to eight: [`push`](Self::push) each record, then take sets until there is no more.
///
/// ```
/// use rohrpost_fusion::{MatchInput, Matcher, Stamp};
/// let input = |name: &str| MatchInput { name: name.into(), lateness_ns: 0, capacity: 16 };
/// let mut matcher = Matcher::new([input("image"), input("scan")], 10);
/// let stamp = |ns| Stamp::new(1, ns);
/// matcher.push(0, stamp(100), 0, "a")?;
/// matcher.push(1, stamp(97), 0, "1")?;
/// assert!(matcher.next_set().is_none(), "the next scan may be nearer");
/// assert_eq!(matcher.missing().unwrap().name, "scan");
/// matcher.push(1, stamp(102), 1, "2")?;
/// assert_eq!(matcher.next_set().unwrap().map(|record| record.value), ["a", "2"]);
/// # Ok::<(), rohrpost_fusion::Refused>(())
/// ```
pub struct Matcher<V, const N: usize> {
    lanes: [Lane<V>; N],
    tolerance_ns: u64,
}

impl<V, const N: usize> Matcher<V, N> {
    /// Joins these streams in sets of at most this size. All memory is taken now.
    pub fn new(inputs: [MatchInput; N], tolerance_ns: u64) -> Self {
        const { assert!(N >= 2 && N <= 8, "a matcher joins two to eight streams") };
        let lanes = inputs.map(|MatchInput { name, lateness_ns, capacity }| Lane {
            name,
            sorted: Sorted::new(capacity.max(1), lateness_ns),
            counts: MatchCounts::default(),
        });
        Self { lanes, tolerance_ns }
    }

    /// Takes a record of a stream, by the stream's index. If there is no room, the stream's oldest record is dropped.
    ///
    /// # Panics
    ///
    /// If there is no such stream.
    pub fn push(&mut self, stream: usize, stamp: Stamp, sequence: u64, value: V) -> Result<(), Refused> {
        let Lane { sorted, counts, .. } = &mut self.lanes[stream];
        counts.pushed += 1;
        match sorted.insert(Record { stamp, sequence, value }) {
            Ok(dropped) => counts.no_room += u64::from(dropped.is_some()),
            Err(refused) => {
                match refused {
                    Refused::Late { .. } => counts.late += 1,
                    Refused::EarlierEpoch { .. } => counts.earlier_epoch += 1,
                    Refused::Repeated { .. } => counts.repeated += 1,
                }
                return Err(refused);
            }
        }
        Ok(())
    }

    /// The next set, a record of each stream; none before enough is known to choose it.
    pub fn next_set(&mut self) -> Option<[Record<V>; N]> {
        self.drop_those_alone();
        let chosen = self.choose().ok()?;
        Some(array::from_fn(|stream| self.lanes[stream].take(chosen[stream])))
    }

    /// The stream that the next set waits for, while others have records; ask after [`next_set`](Self::next_set) gave
    /// none. Of several it is the one that is furthest behind.
    pub fn missing(&self) -> Option<Missing<'_>> {
        let newest = self.lanes.iter().filter_map(|lane| lane.sorted.newest_stamp()).max()?;
        if self.lanes.iter().all(|lane| lane.sorted.len() == 0) {
            return None;
        }
        let stream = self.choose().err()?;
        let lane = &self.lanes[stream];
        let behind_ns = lane.sorted.newest_stamp().and_then(|its| newest.since(its));
        Some(Missing { stream, name: &lane.name, behind_ns })
    }

    /// What became of a stream's records.
    ///
    /// # Panics
    ///
    /// If there is no such stream.
    pub fn counts(&self, stream: usize) -> MatchCounts {
        self.lanes[stream].counts
    }

    /// Records of a stream that wait for those of others.
    ///
    /// # Panics
    ///
    /// If there is no such stream.
    pub fn waiting(&self, stream: usize) -> usize {
        self.lanes[stream].sorted.len()
    }

    /// Drops each first record that can be in no set: another stream's first one is too young, and what follows there
    /// is younger.
    fn drop_those_alone(&mut self) {
        while let Some(latest) = self.lanes.iter().filter_map(Lane::not_before).max() {
            let is_alone = |lane: &Lane<V>| match lane.sorted.place(0) {
                Place::Settled(first) => latest.since(first).is_none_or(|apart_ns| apart_ns > self.tolerance_ns),
                Place::NotBefore(_) | Place::Unknown => false,
            };
            let Some(stream) = self.lanes.iter().position(is_alone) else { return };
            self.lanes[stream].drop_oldest();
        }
    }

    /// The best set, if no first record is alone: for each stream, how many records are before it. Or the stream that
    /// decides with its next record.
    fn choose(&self) -> Result<[usize; N], usize> {
        let lacks = |stream: &usize| !matches!(self.lanes[*stream].sorted.place(0), Place::Settled(_));
        if let Some(stream) = (0..N).filter(lacks).min_by_key(|stream| self.lanes[*stream].sorted.newest_stamp()) {
            return Err(stream);
        }
        let mut tried = [0; N];
        let mut stamps: [Stamp; N] = array::from_fn(|stream| self.lanes[stream].not_before().unwrap_or_default());
        let pivot = latest(&stamps);
        let (mut best, mut least_ns) = (tried, u64::MAX);
        loop {
            let (start, stream) = earliest(&stamps);
            // Of two epochs: the records of this one are at their end.
            let Some(size_ns) = latest(&stamps).since(start) else { return Ok(best) };
            if size_ns < least_ns {
                (best, least_ns) = (tried, size_ns);
            }
            if start >= pivot {
                return Ok(best);
            }
            tried[stream] += 1;
            let next = self.lanes[stream].sorted.place(tried[stream]);
            let (Place::Settled(stamp) | Place::NotBefore(stamp)) = next else { return Err(stream) };
            stamps[stream] = stamp;
            // Sets from here on have the pivot and this end in them, so they are no smaller.
            if latest(&stamps).since(pivot).is_none_or(|size_ns| size_ns >= least_ns) {
                return Ok(best);
            }
            if matches!(next, Place::NotBefore(_)) {
                return Err(stream);
            }
        }
    }
}

impl<V> Lane<V> {
    /// No record that is still to be matched is earlier.
    fn not_before(&self) -> Option<Stamp> {
        match self.sorted.place(0) {
            Place::Settled(stamp) | Place::NotBefore(stamp) => Some(stamp),
            Place::Unknown => None,
        }
    }

    fn drop_oldest(&mut self) {
        self.counts.alone += u64::from(self.sorted.pop_oldest().is_some());
    }

    /// Takes the record with so many before it, which are passed over.
    fn take(&mut self, before: usize) -> Record<V> {
        for _ in 0..before {
            self.counts.passed_over += u64::from(self.sorted.pop_oldest().is_some());
        }
        self.counts.matched += 1;
        self.sorted.pop_oldest().expect("a chosen record is there")
    }
}

/// The earliest stamp, and the index of its stream.
fn earliest(stamps: &[Stamp]) -> (Stamp, usize) {
    let all = stamps.iter().enumerate().map(|(stream, stamp)| (*stamp, stream));
    all.min().unwrap_or_default()
}

fn latest(stamps: &[Stamp]) -> Stamp {
    stamps.iter().copied().max().unwrap_or_default()
}
