//! When a router begins an epoch at its computer's clock: not at one that was wrong from the beginning, and not often.

use rohrpost_mailbox::{CLOCK_SET_NS, monotonic_ns, realtime_ns};
use std::time::Duration;

/// Between epochs that somebody asks for: after each one all nodes measure their clocks anew.
const EPOCH_PAUSE: Duration = Duration::from_secs(10);

/// Two clocks of a computer at one moment, ns.
#[derive(Clone, Copy)]
pub(super) struct ClockReading {
    monotonic_ns: u64,
    wall_ns: u64,
}

impl ClockReading {
    /// The present one.
    pub(super) fn now() -> Self {
        Self { monotonic_ns: monotonic_ns(), wall_ns: realtime_ns() }
    }

    fn ahead_ns(self) -> i128 {
        i128::from(self.wall_ns) - i128::from(self.monotonic_ns)
    }
}

/// What a router remembers of its computer's clock.
pub(super) struct ClockWatch {
    /// When the router, or the last epoch that it asked for, began.
    since: ClockReading,
    has_asked: bool,
}

impl ClockWatch {
    /// A router begins.
    pub(super) fn new(now: ClockReading) -> Self {
        Self { since: now, has_asked: false }
    }

    /// Whether the clock was set meanwhile, by a day or more.
    pub(super) fn was_set(&self, now: ClockReading) -> bool {
        (now.ahead_ns() - self.since.ahead_ns()).unsigned_abs() >= u128::from(CLOCK_SET_NS)
    }

    /// Whether an epoch was asked for so recently that another one has to wait.
    pub(super) fn is_too_soon(&self, now: ClockReading) -> bool {
        let since_ns = now.monotonic_ns.saturating_sub(self.since.monotonic_ns);
        self.has_asked && Duration::from_nanos(since_ns) < EPOCH_PAUSE
    }

    /// An epoch is asked for.
    pub(super) fn asked(&mut self, now: ClockReading) {
        (self.since, self.has_asked) = (now, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY_NS: u64 = CLOCK_SET_NS;

    fn at(monotonic_s: u64, wall_days: u64) -> ClockReading {
        let monotonic_ns = monotonic_s * 1_000_000_000;
        ClockReading { monotonic_ns, wall_ns: wall_days * DAY_NS + monotonic_ns }
    }

    #[test]
    fn a_clock_that_was_wrong_from_the_beginning_is_not_set_and_one_that_jumps_is_once() {
        let mut watch = ClockWatch::new(at(100, 0));
        assert!(!watch.was_set(at(5_000, 0)), "1970, as it was when the router began");
        assert!(watch.was_set(at(5_000, 20_000)) && !watch.is_too_soon(at(5_000, 20_000)));
        watch.asked(at(5_000, 20_000));
        assert!(!watch.was_set(at(6_000, 20_000)), "that has its epoch");
        assert!(watch.was_set(at(6_000, 19_999)), "back again");
    }

    #[test]
    fn after_an_epoch_the_next_one_waits() {
        let mut watch = ClockWatch::new(at(100, 0));
        assert!(!watch.is_too_soon(at(101, 0)), "the first one");
        watch.asked(at(200, 0));
        assert!(watch.is_too_soon(at(209, 0)) && !watch.is_too_soon(at(210, 0)));
    }
}
