//! What bounds assume of the clocks of computers, in one place. Who keeps them is watched: see `steadiness`.

use rohrpost_network::RATE_MAX_PER;

/// What a computer's clock does at most.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockLimits {
    /// How much faster or slower than system time it may be, ns a second: two clocks of 100 ppm, and some room.
    pub rate_ppb: i64,
    /// How much that may change in a second, ns a second: measured clocks in a moving robot change by a tenth of it.
    pub wander_ppb_s: i64,
    /// How much faster or slower somebody may make it than its oscillator is, for good, ns a second: what an oscillator is off, and some room. A time
    /// daemon that corrects an error goes beyond it; what it corrects for good is within it, and is a part of `rate_ppb`.
    pub slewed_ppb: i64,
    /// How much that may change from one look to the next, ns a second: what daemons change that correct nothing but the oscillator.
    pub slewed_change_ppb: i64,
    /// How far off two readings of clocks, one after the other, seem to be at most, ns.
    pub reading_ns: u64,
    /// For how long the computer must have slept for it to have slept, ns.
    pub slept_ns: u64,
}

/// They are assumed of all.
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
