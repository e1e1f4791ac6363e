//! The monotonic clock, and the kernel's stamps by it.
//!
//! The kernel stamps frames by CLOCK_REALTIME. That is the monotonic clock (CLOCK_BOOTTIME) and a difference, which
//! changes only when somebody sets the clock: both are slewed alike, and both run on while the computer sleeps. So the
//! difference is bounded ever more narrowly by reading one clock between two readings of the other. When a reading
//! contradicts what was known, the clock was set, and stamps from before are not used.

use crate::time::{Looked, Stamp};
use rohrpost_mailbox::{monotonic_ns, realtime_ns, slept_ns, unslewed_ns};

/// The kernel computes both clocks from a counter, each rounded on its own.
const ROUNDING_NS: i64 = 2;

/// Makes the monotonic clock wrong, so that a test on one computer knows the true offset. Nothing else uses it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Skew {
    /// It shows so much more.
    pub offset_ns: u64,
    /// It runs so much fast, ns a second, since `begin_ns`.
    pub rate_ppb: i64,
    /// Its rate swings by so much, once in 20 s.
    pub wander_ppb: f64,
    /// True monotonic ns.
    pub begin_ns: u64,
}

const SWING_NS: f64 = 20e9;

impl Skew {
    /// What it shows when the true clock shows this.
    pub fn local_ns(&self, true_ns: u64) -> u64 {
        let since_ns = i128::from(true_ns) - i128::from(self.begin_ns);
        let fast_ns = since_ns * i128::from(self.rate_ppb) / 1_000_000_000;
        let swing_ns = if self.wander_ppb == 0.0 {
            0.0
        } else {
            let turn = std::f64::consts::TAU / SWING_NS;
            (1.0 - (turn * since_ns as f64).cos()) * self.wander_ppb * 1e-9 / turn
        };
        true_ns.wrapping_add(self.offset_ns).wrapping_add_signed(fast_ns as i64).wrapping_add_signed(swing_ns as i64)
    }
}

/// Local time, and what stamps say by it.
#[derive(Debug)]
pub(in crate::shell) struct LocalClock {
    skew: Option<Skew>,
    /// Between these lies CLOCK_REALTIME less the monotonic clock.
    low_ns: i64,
    high_ns: i64,
}

impl LocalClock {
    pub(super) fn new(skew: Option<Skew>) -> Self {
        let (low_ns, high_ns) = difference_ns();
        Self { skew, low_ns, high_ns }
    }

    pub(in crate::shell) fn now_ns(&self) -> u64 {
        self.local_ns(monotonic_ns())
    }

    /// All clocks of this computer.
    pub(super) fn looked(&self) -> Looked {
        let looked = looked();
        let [local_ns, unslewed_ns] = [looked.local_ns, looked.unslewed_ns].map(|ns| self.local_ns(ns));
        Looked { local_ns, unslewed_ns, ..looked }
    }

    fn local_ns(&self, true_ns: u64) -> u64 {
        self.skew.map_or(true_ns, |skew| skew.local_ns(true_ns))
    }

    /// Bounds the difference by another reading. False when CLOCK_REALTIME was set since the last.
    pub(super) fn compare(&mut self) -> bool {
        let (low_ns, high_ns) = difference_ns();
        let both = (self.low_ns.max(low_ns), self.high_ns.min(high_ns));
        let steady = both.0 <= both.1;
        (self.low_ns, self.high_ns) = if steady { both } else { (low_ns, high_ns) };
        steady
    }

    /// A stamp of the kernel. None if CLOCK_REALTIME was set since the last comparison, or if it is not of the last ten
    /// seconds.
    pub(super) fn stamp(&mut self, realtime_ns: u64) -> Option<Stamp> {
        if !self.compare() {
            return None;
        }
        let middle_ns = self.low_ns + (self.high_ns - self.low_ns) / 2;
        let true_ns = realtime_ns.checked_add_signed(-middle_ns)?;
        let age_ns = (monotonic_ns() + 1_000).checked_sub(true_ns)?;
        let doubt_ns = (self.high_ns - middle_ns + ROUNDING_NS) as u32;
        (age_ns < RECENT_NS).then(|| Stamp { ns: self.local_ns(true_ns), doubt_ns, by_kernel: true })
    }
}

/// Two readings are compared if there was so little between them; if not, they are read again, so often.
const NEAR_NS: u64 = 500;
const READ_TRIES: usize = 3;

/// The clocks of this computer, as near each other as they can be read.
pub(crate) fn looked() -> Looked {
    let read = || {
        let before_ns = unslewed_ns();
        let local_ns = monotonic_ns();
        (unslewed_ns().saturating_sub(before_ns), before_ns, local_ns)
    };
    let mut best = read();
    for _ in 1..READ_TRIES {
        if best.0 > NEAR_NS {
            best = best.min(read());
        }
    }
    let (apart_ns, unslewed_ns, local_ns) = best;
    Looked { local_ns, unslewed_ns, apart_ns, slept_ns: slept_ns() }
}

/// A stamp that is older was kept up somewhere, and with it the frame.
const RECENT_NS: u64 = 10_000_000_000;

fn difference_ns() -> (i64, i64) {
    let before = monotonic_ns();
    let real = realtime_ns();
    let after = monotonic_ns();
    let less = |monotonic: u64| real.wrapping_sub(monotonic).cast_signed();
    (less(after) - ROUNDING_NS, less(before) + ROUNDING_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_of_now_lies_between_two_readings_of_now() {
        let mut clock = LocalClock::new(None);
        for _ in 0..1000 {
            let before = monotonic_ns();
            let real = realtime_ns();
            let after = monotonic_ns();
            let stamp = clock.stamp(real).unwrap();
            let doubt_ns = u64::from(stamp.doubt_ns);
            assert!(stamp.ns + doubt_ns >= before && stamp.ns <= after + doubt_ns, "{before} {stamp:?} {after}");
        }
        assert!(clock.high_ns - clock.low_ns < 5_000, "{clock:?}");
    }

    #[test]
    fn after_the_wall_clock_was_set_stamps_are_refused_once() {
        let mut clock = LocalClock::new(None);
        (clock.low_ns, clock.high_ns) = (clock.low_ns + 1_000_000, clock.high_ns + 1_000_000);
        assert_eq!(clock.stamp(realtime_ns()), None);
        assert!(clock.stamp(realtime_ns()).is_some());
        assert_eq!(clock.stamp(realtime_ns() - 60_000_000_000), None, "a minute old");
        assert_eq!(clock.stamp(realtime_ns() + 60_000_000_000), None, "not yet");
    }

    #[test]
    fn a_skewed_clock_runs_as_told() {
        let skew = Skew { offset_ns: 7, rate_ppb: 30_000, wander_ppb: 0.0, begin_ns: 1_000 };
        assert_eq!(skew.local_ns(1_000), 1_007);
        assert_eq!(skew.local_ns(2_000_001_000), 2_000_001_007 + 60_000);
        let swings = Skew { wander_ppb: 500.0, ..skew };
        assert_eq!(swings.local_ns(20_000_001_000), skew.local_ns(20_000_001_000), "once round");
        assert!(swings.local_ns(10_000_001_000) > skew.local_ns(10_000_001_000) + 2_000);
    }
}
