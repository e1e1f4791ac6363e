//! How old data are when they come out of the network: from their stamp, by system time, so that the errors of both clocks are in it.
//!
//! One thread counts, any reads. A package without a stamp (a command, a reply) is not counted.

use rohrpost_mailbox::{Class, Head, LATENCY_BUCKETS, Latency, Node, Options, SystemClock};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Ages of stamped packages that were delivered, by class.
pub struct Ages {
    clock: SystemClock,
    /// Where each bucket begins, ns.
    starts_ns: [u64; LATENCY_BUCKETS],
    classes: Box<[OfClass]>,
}

struct OfClass {
    max_ns: AtomicU64,
    sum_ns: AtomicU64,
    buckets: [AtomicU32; LATENCY_BUCKETS],
}

impl Ages {
    pub(super) fn new(node: &Arc<Node>) -> Self {
        let empty = |_| OfClass {
            max_ns: AtomicU64::new(0),
            sum_ns: AtomicU64::new(0),
            buckets: std::array::from_fn(|_| AtomicU32::new(0)),
        };
        Self {
            clock: SystemClock::open(node),
            starts_ns: std::array::from_fn(|bucket| Latency::bucket_start(bucket).as_nanos() as u64),
            classes: (0..=u8::MAX).map(empty).collect(),
        }
    }

    /// A package was delivered.
    pub(super) fn note(&self, head: &Head, body: &[u8]) {
        let Some(stamp) = body.first_chunk().filter(|_| head.options.has(Options::STAMPED)) else { return };
        // One from the future, by clocks that are not together yet, is new.
        let age_ns = self.clock.now().ns.saturating_sub(u64::from_le_bytes(*stamp));
        let of = &self.classes[usize::from(head.priority.0)];
        // The first bucket begins at 0, so there is always one.
        let bucket = self.starts_ns.partition_point(|start| *start <= age_ns).saturating_sub(1);
        // Nobody else writes: a load and a store are enough.
        of.buckets[bucket].store(of.buckets[bucket].load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        of.sum_ns.store(of.sum_ns.load(Ordering::Relaxed).wrapping_add(age_ns), Ordering::Relaxed);
        of.max_ns.store(of.max_ns.load(Ordering::Relaxed).max(age_ns), Ordering::Relaxed);
    }

    /// Those of a class so far.
    pub fn of(&self, class: Class) -> Latency {
        let of = &self.classes[usize::from(class.0)];
        Latency {
            max: Duration::from_nanos(of.max_ns.load(Ordering::Relaxed)),
            sum: Duration::from_nanos(of.sum_ns.load(Ordering::Relaxed)),
            buckets: std::array::from_fn(|bucket| of.buckets[bucket].load(Ordering::Relaxed)),
        }
    }
}
