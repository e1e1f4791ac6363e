//! The slot tables of the cases.

use crate::tdma::plan::Plan;

/// RTnet's own cycle; slots that have room for a datagram of 1400 B for sure, on an ordinary link.
pub const LOADED: Plan = Plan {
    cycle_us: 5_000,
    synchronisation_us: 500,
    guard_us: 150,
    pitch_us: 430,
    link: "100 Mbit/s",
    masters: 2,
    flows: &[],
};
