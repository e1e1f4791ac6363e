//! The clocks of a computer: timeouts, leases and ages are measured by time that passed, never by system time.
//!
//! | | runs on while the computer sleeps | slewed by a time daemon | set | for |
//! | --- | --- | --- | --- | --- |
//! | [`monotonic_ns`] | yes | yes | no | all but what stands below |
//! | [`unslewed_ns`] | no | no | no | to see that the first is slewed |
//! | [`slept_ns`] | alone then | no | no | to see that the computer slept |
//! | [`realtime_ns`] | yes | yes | yes | the beginning of system time |

/// Nanoseconds that passed since this computer was started, also those for which it slept; the same for all its
/// processes.
#[inline]
pub fn monotonic_ns() -> u64 {
    now_ns(libc::CLOCK_BOOTTIME)
}

/// The same by the computer's oscillator alone, which nobody slews; it stands still while the computer sleeps.
#[inline]
pub fn unslewed_ns() -> u64 {
    now_ns(libc::CLOCK_MONOTONIC_RAW)
}

/// Readings of two clocks are compared if there was so little between them.
const READ_TRIES: usize = 4;

/// For how long this computer has slept since it was started, ns; at most a few microseconds off, unless this thread is
/// held up each time that it looks.
pub fn slept_ns() -> u64 {
    let look = || {
        let before_ns = now_ns(libc::CLOCK_MONOTONIC);
        let passed_ns = monotonic_ns();
        let after_ns = now_ns(libc::CLOCK_MONOTONIC);
        (after_ns - before_ns, passed_ns.saturating_sub(before_ns))
    };
    (0..READ_TRIES).map(|_| look()).min().map_or(0, |(_, slept_ns)| slept_ns)
}

/// For how long it has slept at least, ns; quicker to tell than [`slept_ns`]. `passed_ns`: a reading of
/// [`monotonic_ns`] just before.
#[inline]
pub(crate) fn slept_ns_min(passed_ns: u64) -> u64 {
    passed_ns.saturating_sub(now_ns(libc::CLOCK_MONOTONIC))
}

/// Nanoseconds since 1970 as this computer's wall clock has them. It may be set, even backwards.
pub fn realtime_ns() -> u64 {
    now_ns(libc::CLOCK_REALTIME)
}

#[inline]
fn now_ns(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: writes the time, which lives here. All of these clocks exist on every Linux that has what mailboxes need,
    // so this cannot fail; 0 would be the year 1970.
    unsafe { libc::clock_gettime(clock, &raw mut time) };
    (time.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(time.tv_nsec as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_that_passed_is_time_awake_and_asleep() {
        for _ in 0..100 {
            let before_ns = now_ns(libc::CLOCK_MONOTONIC) + slept_ns();
            let passed_ns = monotonic_ns();
            assert!(passed_ns + 1_000_000_000 > before_ns, "{before_ns} and {passed_ns}");
        }
        let (once, unslewed) = (monotonic_ns(), unslewed_ns());
        std::thread::sleep(std::time::Duration::from_millis(2));
        assert!(monotonic_ns() - once >= 1_900_000 && unslewed_ns() - unslewed >= 1_500_000);
    }
}
