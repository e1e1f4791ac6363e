//! Durations that one thread notes and any reads: the longest, the mean, and a histogram.

use rohrpost_mailbox::{LATENCY_BUCKETS, Latency};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// A shared [`Latency`]: one thread writes, so a load and a store are enough for each number.
#[derive(Debug)]
pub struct Latencies {
    max_ns: AtomicU64,
    sum_ns: AtomicU64,
    buckets: [AtomicU32; LATENCY_BUCKETS],
}

impl Default for Latencies {
    fn default() -> Self {
        let buckets = std::array::from_fn(|_| AtomicU32::new(0));
        Self { max_ns: AtomicU64::new(0), sum_ns: AtomicU64::new(0), buckets }
    }
}

impl Latencies {
    /// Counts a duration.
    pub(crate) fn note(&self, ns: u64) {
        let bucket = &self.buckets[Latency::bucket_of(Duration::from_nanos(ns))];
        bucket.store(bucket.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        self.sum_ns.store(self.sum_ns.load(Ordering::Relaxed).wrapping_add(ns), Ordering::Relaxed);
        self.max_ns.store(self.max_ns.load(Ordering::Relaxed).max(ns), Ordering::Relaxed);
    }

    /// All so far.
    pub fn get(&self) -> Latency {
        Latency {
            max: Duration::from_nanos(self.max_ns.load(Ordering::Relaxed)),
            sum: Duration::from_nanos(self.sum_ns.load(Ordering::Relaxed)),
            buckets: std::array::from_fn(|bucket| self.buckets[bucket].load(Ordering::Relaxed)),
        }
    }
}
