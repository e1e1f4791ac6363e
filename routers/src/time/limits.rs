//! The assumptions of bounds about the computers' clocks, in one place. `steadiness` watches that they hold.

use rohrpost_network::RATE_MAX_PER;

/// Limits of a computer's clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockLimits {
    /// Largest rate against system time, ns a second: two clocks of 100 ppm, and some margin.
    pub rate_ppb: i64,
    /// Largest change of the rate in a second, ns a second: clocks measured in a moving robot change by a tenth of it.
    pub wander_ppb_s: i64,
    /// Largest permanent rate correction against the oscillator, ns a second: the error of an oscillator, and some
    /// margin. A time daemon that corrects an offset exceeds it; its permanent correction is within it, and is a part
    /// of `rate_ppb`.
    pub slewed_ppb: i64,
    /// Largest change of that from one look to the next, ns a second: the changes of a daemon that corrects only the
    /// oscillator.
    pub slewed_change_ppb: i64,
    /// Largest apparent distance of two clock readings, one after the other, ns.
    pub reading_ns: u64,
    /// A shorter sleep of the computer counts as none, ns.
    pub slept_ns: u64,
}

/// The limits of all nodes.
pub const LIMITS: ClockLimits = ClockLimits {
    rate_ppb: 1_000_000_000 / RATE_MAX_PER as i64,
    wander_ppb_s: 500,
    slewed_ppb: 200_000,
    slewed_change_ppb: 30_000,
    reading_ns: 1_500,
    slept_ns: 5_000_000,
};

const _: () =
    assert!(LIMITS.slewed_ppb < LIMITS.rate_ppb, "what is allowed for good is a part of what clocks may be off");
