//! The local monotonic clock: timeouts, leases and ages are measured by it, never by system time.

/// Nanoseconds on this computer's monotonic clock; the same for all its processes.
#[inline]
pub fn monotonic_ns() -> u64 {
    now_ns(libc::CLOCK_MONOTONIC)
}

/// Nanoseconds since 1970 as this computer's wall clock has them. It may be set, even backwards.
pub fn realtime_ns() -> u64 {
    now_ns(libc::CLOCK_REALTIME)
}

#[inline]
fn now_ns(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: writes the time, which lives here. Both clocks exist on every Linux, so this cannot fail; 0 would be the year 1970.
    unsafe { libc::clock_gettime(clock, &raw mut time) };
    (time.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(time.tv_nsec as u64)
}
