//! Counters of a mailbox, in its segment's first page: anyone may read them, and reading changes nothing.
//!
//! A row a class, claimed by the first that needs it; the last row takes all classes for which none is left. The
//! process that causes or finds a loss counts it. If it is killed between counting and acting, or its mailbox is
//! replaced just then, the count can be one too high, never too low: no loss is hidden.

use crate::name::{Class, Priority};
use crate::slots::word::Victim;
use crate::step::step;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Rows of a mailbox: nine classes and the rest.
pub(crate) const ROWS: usize = 10;
/// Buckets of a latency histogram: two to the octave, from 256 ns up to 2^36 ns (69 s).
pub const LATENCY_BUCKETS: usize = 56;
const FIRST_OCTAVE: u32 = 8;
const USED: u32 = 0x100;
const REST: u32 = 0x200;

crate::causes! {
    /// Why a package was lost.
    pub enum Loss {
        /// Accepted, then pushed out by a more important one.
        Displaced = "displaced",
        /// Not accepted: the mailbox was full. Its sender was told.
        Refused = "refused",
        /// Older than the mailbox's `max-age` when its turn came.
        Stale = "stale",
        /// Its receiver died with it in hand, twice.
        Poison = "poison",
        /// Accepted, then the mailbox was closed or replaced by one of another shape before it was received.
        Closed = "closed",
        /// Not accepted: its sender died while it wrote.
        Unfinished = "unfinished",
        /// Accepted, then its own sender's newer one took its place, as the policy `latest` is for. No reason to worry.
        Replaced = "replaced",
    }
}

impl Loss {
    /// Whether somebody misses the package. Nobody misses one that was replaced by a newer.
    pub const fn is_missed(self) -> bool {
        !matches!(self, Self::Replaced)
    }

    /// Whether the package had been accepted: sent = received + such losses + depth.
    pub const fn was_accepted(self) -> bool {
        matches!(self, Self::Displaced | Self::Stale | Self::Poison | Self::Closed | Self::Replaced)
    }
}

#[repr(C, align(64))]
pub(crate) struct CounterRow {
    /// 0 unused; 0x100 + class; 0x200 the rest.
    class: AtomicU32,
    padding: AtomicU32,
    received: AtomicU64,
    losses: [AtomicU64; Loss::ALL.len()],
    latency_max_ns: AtomicU64,
    latency: [AtomicU32; LATENCY_BUCKETS],
    latency_sum_ns: AtomicU64,
    body_bytes: AtomicU64,
}
const _: () = assert!(size_of::<CounterRow>() == 320);

/// The rows of a mailbox.
#[repr(C)]
pub(crate) struct Counters([CounterRow; ROWS]);

impl Counters {
    /// The row of a class, claimed if it is new. Bounded: one pass over the rows.
    fn row(&self, class: Class) -> &CounterRow {
        let mine = USED | u32::from(class.0);
        for row in &self.0[..ROWS - 1] {
            // Looked at before it is claimed, so that counting does not write what it only reads.
            let there = match row.class.load(Ordering::Relaxed) {
                0 => row
                    .class
                    .compare_exchange(0, mine, Ordering::Relaxed, Ordering::Relaxed)
                    .map_or_else(|there| there, |_| mine),
                there => there,
            };
            if there == mine {
                return row;
            }
        }
        let rest = &self.0[ROWS - 1];
        rest.class.store(REST, Ordering::Relaxed);
        rest
    }

    pub(crate) fn lost(&self, priority: Priority, cause: Loss, packages: u64) {
        self.row(Class(priority.0)).losses[cause as usize].fetch_add(packages, Ordering::Relaxed);
        step!("counters: loss");
    }

    /// A package lost its place to another.
    pub(crate) fn gave_way(&self, victim: Victim) {
        let cause = if victim.replaced { Loss::Replaced } else { Loss::Displaced };
        self.lost(victim.priority, cause, 1);
    }

    /// By the receiver alone, which may therefore load and store.
    #[inline(always)]
    pub(crate) fn received(&self, priority: Priority, waited_ns: u64, bytes: usize) {
        let row = self.row(Class(priority.0));
        let bucket = &row.latency[bucket(waited_ns)];
        bucket.store(bucket.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
        if waited_ns > row.latency_max_ns.load(Ordering::Relaxed) {
            row.latency_max_ns.store(waited_ns, Ordering::Relaxed);
        }
        let add = |count: &AtomicU64, more: u64| {
            count.store(count.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
        };
        add(&row.latency_sum_ns, waited_ns);
        add(&row.body_bytes, bytes as u64);
        add(&row.received, 1);
    }

    /// A new segment goes on counting where the one it replaces stopped. The caller owns both.
    pub(crate) fn carry_over(&self, old: &Self) {
        for (to, from) in self.0.iter().zip(&old.0) {
            let copy32 = |to: &AtomicU32, from: &AtomicU32| to.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
            let copy64 = |to: &AtomicU64, from: &AtomicU64| to.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
            copy32(&to.class, &from.class);
            copy64(&to.received, &from.received);
            copy64(&to.latency_max_ns, &from.latency_max_ns);
            copy64(&to.latency_sum_ns, &from.latency_sum_ns);
            copy64(&to.body_bytes, &from.body_bytes);
            to.losses.iter().zip(&from.losses).for_each(|(to, from)| copy64(to, from));
            to.latency.iter().zip(&from.latency).for_each(|(to, from)| copy32(to, from));
        }
    }

    /// Packages that were accepted and are no longer there: received, or lost and counted.
    pub(crate) fn accepted(&self) -> u64 {
        let accepted = |row: &ClassTraffic| {
            let lost = Loss::ALL.into_iter().filter(|cause| cause.was_accepted()).map(|cause| row.lost(cause));
            saturating_sum(lost.chain([row.received]))
        };
        saturating_sum(self.0.iter().filter_map(CounterRow::read).map(|row| accepted(&row)))
    }

    /// The rows in use, by class as it stands in the names of their senders; the rest last.
    pub(crate) fn read(&self) -> Vec<ClassTraffic> {
        let mut rows: Vec<ClassTraffic> = self.0.iter().filter_map(CounterRow::read).collect();
        rows.sort_by_key(|row| std::cmp::Reverse(row.class));
        rows
    }
}

impl CounterRow {
    fn read(&self) -> Option<ClassTraffic> {
        let class = match self.class.load(Ordering::Relaxed) {
            0 => return None,
            REST => None,
            class => Some(Class(class as u8)),
        };
        Some(ClassTraffic {
            class,
            received: self.received.load(Ordering::Relaxed),
            body_bytes: self.body_bytes.load(Ordering::Relaxed),
            losses: std::array::from_fn(|i| self.losses[i].load(Ordering::Relaxed)),
            latency: Latency {
                max: Duration::from_nanos(self.latency_max_ns.load(Ordering::Relaxed)),
                sum: Duration::from_nanos(self.latency_sum_ns.load(Ordering::Relaxed)),
                buckets: std::array::from_fn(|i| self.latency[i].load(Ordering::Relaxed)),
            },
        })
    }
}

/// Adds up counts that other processes wrote, and which therefore may be anything.
pub fn saturating_sum(counts: impl IntoIterator<Item = u64>) -> u64 {
    counts.into_iter().fold(0, u64::saturating_add)
}

fn bucket(ns: u64) -> usize {
    if ns < 1 << FIRST_OCTAVE {
        return 0;
    }
    let octave = ns.ilog2();
    let half = (ns >> (octave - 1)) & 1;
    ((octave - FIRST_OCTAVE) as usize * 2 + half as usize).min(LATENCY_BUCKETS - 1)
}

/// Shortest time that counts in a bucket, nanoseconds.
fn bucket_start_ns(bucket: usize) -> f64 {
    let octave = 2f64.powi(FIRST_OCTAVE as i32 + (bucket / 2) as i32);
    if bucket == 0 { 0.0 } else { octave * (1.0 + 0.5 * (bucket % 2) as f64) }
}

/// What one class did in a mailbox.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassTraffic {
    /// The class, that is, the priority its packages came with; none: all classes for which there was no row left.
    pub class: Option<Class>,
    /// Packages received.
    pub received: u64,
    /// Bytes of their bodies.
    pub body_bytes: u64,
    /// Packages lost, in the order of [`Loss::ALL`].
    pub losses: [u64; Loss::ALL.len()],
    /// Time from publishing to being taken.
    pub latency: Latency,
}

impl ClassTraffic {
    /// Lost for this cause.
    pub fn lost(&self, cause: Loss) -> u64 {
        self.losses[cause as usize]
    }

    /// Lost for any cause for which somebody misses them ([`Loss::is_missed`]).
    pub fn lost_in_all(&self) -> u64 {
        saturating_sum(Loss::ALL.into_iter().filter(|cause| cause.is_missed()).map(|cause| self.lost(cause)))
    }

    /// Adds what the same class did in another mailbox.
    pub fn add(&mut self, other: &Self) {
        self.received = self.received.saturating_add(other.received);
        self.body_bytes = self.body_bytes.saturating_add(other.body_bytes);
        self.losses.iter_mut().zip(&other.losses).for_each(|(a, b)| *a = a.saturating_add(*b));
        self.latency.add(&other.latency);
    }
}

/// A histogram of waiting times, two buckets to the octave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// The longest.
    pub max: Duration,
    /// All together.
    pub sum: Duration,
    /// Packages by waiting time.
    pub buckets: [u32; LATENCY_BUCKETS],
}

impl Default for Latency {
    fn default() -> Self {
        Self { max: Duration::ZERO, sum: Duration::ZERO, buckets: [0; LATENCY_BUCKETS] }
    }
}

impl Latency {
    /// Counts a time.
    pub fn count_one(&mut self, time: Duration) {
        self.max = self.max.max(time);
        self.sum += time;
        let count = &mut self.buckets[Self::bucket_of(time)];
        *count = count.saturating_add(1);
    }

    /// Adds another histogram.
    pub fn add(&mut self, other: &Self) {
        self.max = self.max.max(other.max);
        self.sum = self.sum.saturating_add(other.sum);
        self.buckets.iter_mut().zip(&other.buckets).for_each(|(a, b)| *a = a.saturating_add(*b));
    }

    /// The bucket that a time counts in.
    pub fn bucket_of(time: Duration) -> usize {
        bucket(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Shortest time that counts in a bucket; each begins where the one before ends.
    pub fn bucket_start(bucket: usize) -> Duration {
        Duration::from_nanos(bucket_start_ns(bucket) as u64)
    }

    /// What was counted since `earlier` was read. The longest is not known for a part: it stays the longest of all.
    pub fn since(&self, earlier: &Self) -> Self {
        let buckets = std::array::from_fn(|i| self.buckets[i].saturating_sub(earlier.buckets[i]));
        Self { max: self.max, sum: self.sum.saturating_sub(earlier.sum), buckets }
    }

    /// Packages counted.
    pub fn count(&self) -> u64 {
        self.buckets.iter().map(|n| u64::from(*n)).sum()
    }

    /// The mean, exact; none when nothing was received.
    pub fn mean(&self) -> Option<Duration> {
        let count = self.count();
        (count > 0).then(|| Duration::from_secs_f64(self.sum.as_secs_f64() / count as f64))
    }

    /// The time that this share of the packages (0..=1) did not exceed, interpolated inside its bucket (so within a
    /// quarter or so); none when nothing was received.
    pub fn quantile(&self, share: f64) -> Option<Duration> {
        let mut before = 0.0;
        let wanted = share.clamp(0.0, 1.0) * self.count() as f64;
        for (i, n) in self.buckets.iter().enumerate().filter(|(_, n)| **n > 0) {
            let here = f64::from(*n);
            if before + here >= wanted {
                let (start, end) = (bucket_start_ns(i), bucket_start_ns(i + 1));
                let ns = start + (end - start) * ((wanted - before) / here);
                return Some(Duration::from_nanos(ns as u64).min(self.max));
            }
            before += here;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn counters() -> Counters {
        Counters(std::array::from_fn(|_| CounterRow {
            class: AtomicU32::new(0),
            padding: AtomicU32::new(0),
            received: AtomicU64::new(0),
            losses: std::array::from_fn(|_| AtomicU64::new(0)),
            latency_max_ns: AtomicU64::new(0),
            latency: std::array::from_fn(|_| AtomicU32::new(0)),
            latency_sum_ns: AtomicU64::new(0),
            body_bytes: AtomicU64::new(0),
        }))
    }

    #[test]
    fn classes_without_a_row_share_the_last() {
        let counters = counters();
        for class in 0..=255 {
            counters.lost(Priority(class), Loss::Refused, 1);
            counters.received(Priority(class), 1_000, 1);
        }
        let rows = counters.read();
        assert_eq!(rows.len(), ROWS);
        assert_eq!(rows[0].class, Some(Class(ROWS as u8 - 2)));
        assert_eq!((rows[0].received, rows[0].lost(Loss::Refused)), (1, 1));
        let rest = rows.last().unwrap();
        assert_eq!((rest.class, rest.received), (None, 256 - ROWS as u64 + 1));
    }

    #[test]
    fn damaged_counts_add_up_to_the_most_and_not_to_a_panic() {
        let counters = counters();
        for class in [3, 4] {
            counters.received(Priority(class), u64::MAX, 1);
            counters.row(Class(class)).received.store(u64::MAX - 1, Ordering::Relaxed);
            counters.row(Class(class)).losses.iter().for_each(|losses| losses.store(u64::MAX, Ordering::Relaxed));
        }
        assert_eq!(counters.accepted(), u64::MAX);
        let [mut all, other] = counters.read().try_into().unwrap();
        all.add(&other);
        assert_eq!((all.received, all.lost(Loss::Stale), all.lost_in_all()), (u64::MAX, u64::MAX, u64::MAX));
        assert_eq!(all.latency.count(), 2);
    }

    #[test]
    fn quantiles_of_nothing_are_nothing_and_of_one_are_it() {
        let counters = counters();
        assert!(counters.read().is_empty());
        counters.received(Priority(9), 100_000, 40);
        assert_eq!(counters.read()[0].body_bytes, 40);
        let latency = &counters.read()[0].latency;
        assert_eq!((latency.count(), latency.mean()), (1, Some(latency.max)));
        assert_eq!(latency.max, Duration::from_micros(100));
        assert_eq!(latency.quantile(1.0), Some(Duration::from_micros(100)));
        assert_eq!(latency.since(latency).quantile(0.5), None);
    }

    proptest! {
        #[test]
        fn a_time_lies_in_its_bucket(ns in 0u64..1 << 35) {
            let b = bucket(ns);
            prop_assert!(bucket_start_ns(b) <= ns as f64);
            prop_assert!((ns as f64) < bucket_start_ns(b + 1));
        }
    }
}
