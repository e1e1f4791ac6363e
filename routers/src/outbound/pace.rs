//! Rate limit in bytes a second: a token bucket, kept as the time at which it will be full.
//!
//! A flood keeps the bucket empty. A package more important than the last one leaves nevertheless, one datagram in
//! advance: it waits for the datagram on the wire, and not for the rate limit as well.

use crate::settings::Settings;

/// A burst of this length may leave at once: waking up takes a part of it.
const BURST_NS: u64 = 1_000_000;
/// Fractional bits of the time of a byte.
const FRACTION: u32 = 20;

#[derive(Clone, Copy, Debug)]
pub(super) struct Pacer {
    /// Time that a byte takes, in 2^-20 ns.
    byte: u128,
    /// Headers of each datagram.
    pub(super) overhead_bytes: usize,
    /// When all that left is through, at the given rate.
    through_ns: u64,
    /// How far that may lie ahead.
    ahead_ns: u64,
    /// How much farther for a package more important than the last: a largest datagram.
    advance_ns: u64,
    /// Level of the last datagram.
    level: u8,
}

impl Pacer {
    pub(super) fn new(settings: &Settings) -> Self {
        let byte = (1_000_000_000 << FRACTION) / u128::from(settings.network.rate_bytes_s.max(1));
        let overhead_bytes = settings.overhead_bytes();
        let mut pace = Self { byte, overhead_bytes, through_ns: 0, ahead_ns: 0, advance_ns: 0, level: 0 };
        pace.advance_ns = pace.takes_ns(settings.network.datagram_bytes_max + overhead_bytes);
        pace.ahead_ns = BURST_NS.saturating_sub(pace.advance_ns);
        pace
    }

    /// Whether a datagram with this highest level may leave now; else when.
    pub(super) fn may_leave(&self, now_ns: u64, level: u8) -> Result<(), u64> {
        let hurries = level < self.level;
        let ahead_ns = self.ahead_ns + if hurries { self.advance_ns } else { 0 };
        let from_ns = self.through_ns.saturating_sub(ahead_ns);
        if from_ns <= now_ns { Ok(()) } else { Err(from_ns) }
    }

    /// A datagram has left; level none: without packages.
    pub(super) fn left(&mut self, now_ns: u64, bytes: usize, level: Option<u8>) {
        self.level = level.unwrap_or(self.level);
        self.takes(now_ns, bytes + self.overhead_bytes);
    }

    /// Bytes go over the wire, with all headers.
    pub(super) fn takes(&mut self, now_ns: u64, bytes: usize) {
        if bytes > 0 {
            self.through_ns = self.through_ns.max(now_ns).saturating_add(self.takes_ns(bytes));
        }
    }

    fn takes_ns(&self, bytes: usize) -> u64 {
        let ns = (bytes as u128 * self.byte) >> FRACTION;
        u64::try_from(ns).unwrap_or(u64::MAX)
    }
}
