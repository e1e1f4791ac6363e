//! Periodic events, more often than a process can wake up: each tick has those that are due in it.

use nix::sys::time::{TimeSpec, TimeValLike};
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};

/// From tick to tick.
pub(super) const TICK_NS: u64 = 200_000;

/// A periodic event.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    began_ns: u64,
    each_ns: u64,
    done: u64,
}

impl Pace {
    /// From a time on.
    pub(super) fn new(began_ns: u64, each_ns: u64) -> Self {
        Self { began_ns, each_ns, done: 0 }
    }

    /// Number of the next event, from 0, and the beginning of its tick, if that has come. The event then counts as
    /// done.
    pub(super) fn next_due(&mut self, now_ns: u64) -> Option<(u64, u64)> {
        let due_ns = self.began_ns.saturating_add(self.done * self.each_ns / TICK_NS * TICK_NS);
        (due_ns <= now_ns).then(|| {
            self.done += 1;
            (self.done - 1, due_ns)
        })
    }
}

/// A descriptor that can be read at each tick.
pub(super) fn ticks() -> nix::Result<TimerFd> {
    let timer = TimerFd::new(ClockId::CLOCK_MONOTONIC, TimerFlags::TFD_CLOEXEC | TimerFlags::TFD_NONBLOCK)?;
    timer.set(Expiration::Interval(TimeSpec::nanoseconds(TICK_NS as i64)), TimerSetTimeFlags::empty())?;
    Ok(timer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_tick_has_all_missed_events_with_their_due_times() {
        let mut pace = Pace::new(1000, TICK_NS / 2);
        assert_eq!(pace.next_due(999), None);
        let due = |pace: &mut Pace, now_ns| std::iter::from_fn(|| pace.next_due(now_ns)).collect::<Vec<_>>();
        assert_eq!(due(&mut pace, 1000), [(0, 1000), (1, 1000)], "all of the first tick");
        let (second, third) = (1000 + TICK_NS, 1000 + 2 * TICK_NS);
        assert_eq!(due(&mut pace, third), [(2, second), (3, second), (4, third), (5, third)], "one was slept through");
        assert_eq!(due(&mut Pace::new(u64::MAX, 0), 1 << 60), [], "never");
    }
}
