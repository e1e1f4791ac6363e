//! Bytes a second: a bucket of tokens, kept as the time at which it will be full.

use crate::broken::broken;
use crate::settings::Settings;

/// A burst of so much time may leave at once: waking up takes a part of it.
const BURST_NS: u64 = 1_000_000;
/// Fractional bits of the time of a byte.
const FRACTION: u32 = 20;

#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Time that a byte takes, in 2^-20 ns.
    byte: u128,
    overhead_bytes: usize,
    /// What has left is through by then, at the given rate.
    through_ns: u64,
    /// How far that may lie ahead.
    ahead_ns: u64,
}

impl Pace {
    pub(super) fn new(settings: &Settings) -> Self {
        let byte = (1_000_000_000 << FRACTION) / u128::from(settings.network.rate_bytes_s.max(1));
        let mut pace = Self { byte, overhead_bytes: settings.overhead_bytes(), through_ns: 0, ahead_ns: 0 };
        pace.ahead_ns = BURST_NS.saturating_sub(pace.takes_ns(settings.network.datagram_bytes_max));
        pace
    }

    /// Whether a datagram may leave now; else when.
    pub(super) fn may_leave(&self, now_ns: u64) -> Result<(), u64> {
        let from_ns = self.through_ns.saturating_sub(self.ahead_ns);
        if from_ns <= now_ns || broken!(Unpaced) { Ok(()) } else { Err(from_ns) }
    }

    pub(super) fn left(&mut self, now_ns: u64, bytes: usize) {
        self.through_ns = self.through_ns.max(now_ns).saturating_add(self.takes_ns(bytes));
    }

    fn takes_ns(&self, bytes: usize) -> u64 {
        let ns = ((bytes + self.overhead_bytes) as u128 * self.byte) >> FRACTION;
        u64::try_from(ns).unwrap_or(u64::MAX)
    }
}
