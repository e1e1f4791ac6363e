//! The local monotonic clock: timeouts, leases and ages are measured by it, never by system time.

use nix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// Nanoseconds on this computer's monotonic clock; the same for all its processes.
pub fn monotonic_ns() -> u64 {
    now_ns(ClockId::CLOCK_MONOTONIC)
}

/// Nanoseconds since 1970 as this computer's wall clock has them. It may be set, even backwards.
pub fn realtime_ns() -> u64 {
    now_ns(ClockId::CLOCK_REALTIME)
}

fn now_ns(clock: ClockId) -> u64 {
    // Both clocks exist on every Linux, so this cannot fail; 0 would be the year 1970.
    clock_gettime(clock).map_or(0, |time| Duration::from(time).as_nanos() as u64)
}
