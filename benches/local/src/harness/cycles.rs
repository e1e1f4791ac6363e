//! A clock for spans of tens of nanoseconds.

use crate::statistics::median;
use rohrpost_mailbox::monotonic_ns;

/// Times spans of tens of nanoseconds: by the processor's counter if it can be read in order.
pub struct CycleCounter {
    ns_per_tick: f64,
    /// Median of two readings with nothing in between.
    own_ticks: f64,
}

impl CycleCounter {
    /// Measures how fast it counts, and how long a reading takes: ten milliseconds.
    pub fn calibrate() -> Self {
        let (began, began_ns) = (Self::now(), monotonic_ns());
        while monotonic_ns() < began_ns + 10_000_000 {}
        let (ended, ended_ns) = (Self::now(), monotonic_ns());
        let spans = (0..1001).map(|_| {
            let began = Self::now();
            (Self::now() - began) as f64
        });
        let own_ticks = median(spans).unwrap_or_default();
        Self { ns_per_tick: (ended_ns - began_ns) as f64 / (ended - began).max(1) as f64, own_ticks }
    }

    /// A reading, after all that comes before it and before all that comes after.
    #[cfg(target_arch = "x86_64")]
    pub fn now() -> u64 {
        use std::arch::x86_64::{_mm_lfence, _rdtsc};
        // SAFETY: any x86-64 has both; neither touches memory. The fences keep what is timed between two readings.
        unsafe {
            _mm_lfence();
            let ticks = _rdtsc();
            _mm_lfence();
            ticks
        }
    }

    /// A reading.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn now() -> u64 {
        monotonic_ns()
    }

    /// Nanoseconds between two readings, without what reading takes.
    pub fn ns(&self, began: u64, ended: u64) -> f64 {
        ((ended - began) as f64 - self.own_ticks).max(0.0) * self.ns_per_tick
    }
}
