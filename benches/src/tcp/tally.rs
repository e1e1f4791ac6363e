//! Counts of a crowd, visible to its parent.

use rohrpost_bench_local::harness::{Samples, Zeroable};
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts of one turn. One process writes each of them.
#[repr(C)]
pub struct Tally {
    /// Sessions that are registered.
    pub up: Count,
    /// 1 while measuring, 2 afterwards.
    pub phase: Count,
    /// Packages sent that count.
    pub sent: Count,
    /// Of these, received.
    pub came: Count,
    /// Packages received while measuring, whenever they were sent.
    pub meanwhile: Count,
    /// Connections that a hostile program made.
    pub hostile: Count,
    /// From when a package was due to its delivery, µs.
    pub latencies: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for Tally {}

/// One count.
#[repr(transparent)]
pub struct Count(AtomicU64);

impl Count {
    /// So far.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// From now on.
    pub fn set(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }

    /// Some more.
    pub fn add(&self, more: u64) {
        self.set(self.get() + more);
    }
}
