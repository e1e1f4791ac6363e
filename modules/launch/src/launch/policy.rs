//! Whether and when a module that has ended is started again. Knows no process; time comes as an argument.

use rohrpost_config::{Restart, RestartPolicy};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Longest pause before a restart, unless the configured one is longer, or the time in which restarts are counted is
/// shorter.
const BACKOFF_MAX: Duration = Duration::from_secs(10);
/// Without an end for so long, and for the time in which restarts are counted, the next begins with the short pause
/// again.
pub(super) const STEADY: Duration = Duration::from_secs(10);

/// What follows an end.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// Started again after this pause.
    Again(Duration),
    /// The module stays ended.
    Stay,
    /// The module would be started again, had it not ended too often already.
    GivenUp,
}

/// A module's restart policy, and how often it was needed lately.
pub(super) struct Policy {
    restart: Restart,
    /// When it ended, of the times it was to be started again; the last of them, in which restarts are counted.
    ends: VecDeque<Instant>,
    last_end: Option<Instant>,
    /// Ends since it last worked for long.
    in_a_row: u32,
    backoff: Duration,
}

impl Policy {
    pub(super) fn new(restart: Restart) -> Self {
        Self { restart, ends: VecDeque::new(), last_end: None, in_a_row: 0, backoff: restart.backoff }
    }

    pub(super) fn restart(&self) -> Restart {
        self.restart
    }

    /// Restarts that count now.
    pub(super) fn counted(&self) -> u32 {
        self.ends.len() as u32
    }

    /// Ends since it last worked for long, with the present one.
    pub(super) fn in_a_row(&self) -> u32 {
        self.in_a_row
    }

    /// A process has ended by itself.
    pub(super) fn ended(&mut self, success: bool, now: Instant) -> Next {
        let again = match self.restart.policy {
            RestartPolicy::Never => false,
            RestartPolicy::OnFailure => !success,
            RestartPolicy::Always => true,
        };
        if !again {
            return Next::Stay;
        }
        self.ends.push_back(now);
        self.ends.retain(|at| now - *at <= self.restart.within);
        if self.ends.len() > self.restart.at_most as usize {
            return Next::GivenUp;
        }
        let steady = self.restart.within.max(STEADY);
        if self.last_end.replace(now).is_none_or(|last| now - last > steady) {
            self.backoff = self.restart.backoff;
            self.in_a_row = 0;
        }
        self.in_a_row = self.in_a_row.saturating_add(1);
        let pause = self.backoff;
        let longest = BACKOFF_MAX.min(self.restart.within).max(self.restart.backoff);
        self.backoff = (self.backoff * 2).min(longest);
        Next::Again(pause)
    }

    /// A person has started it: what was before counts no more.
    pub(super) fn begin_anew(&mut self) {
        self.ends.clear();
        self.last_end = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_until_it_is_given_up_and_a_person_begins_anew() {
        let (ms, minute) = (Duration::from_millis, Duration::from_secs(60));
        let restart = Restart { policy: RestartPolicy::OnFailure, backoff: ms(4000), at_most: 3, within: minute };
        let (mut policy, start) = (Policy::new(restart), Instant::now());
        for (at_s, success, next, why) in [
            (0, true, Next::Stay, "it meant to end"),
            (1, false, Next::Again(ms(4000)), "the first time"),
            (2, false, Next::Again(ms(8000)), "twice as long"),
            (3, false, Next::Again(ms(10_000)), "but never longer"),
            (4, false, Next::GivenUp, "once too often"),
            (70, false, Next::Again(ms(4000)), "long after, it counts anew"),
        ] {
            assert_eq!(policy.ended(success, start + Duration::from_secs(at_s)), next, "{why}");
        }
        for _ in 0..3 {
            policy.ended(false, start + Duration::from_secs(71));
        }
        policy.begin_anew();
        assert_eq!(policy.ended(false, start + Duration::from_secs(72)), Next::Again(ms(4000)));
        let mut policy = Policy::new(Restart { backoff: minute, within: minute * 10, ..restart });
        for at_s in [0, 61, 122] {
            assert_eq!(policy.ended(false, start + Duration::from_secs(at_s)), Next::Again(minute), "never shorter");
        }
    }

    /// A router is never given up; the pauses bound how often it is tried, and how much is said of it, however long
    /// each incarnation is.
    #[test]
    fn a_crash_loop_that_never_ends_is_slow() {
        let (ms, second) = (Duration::from_millis, Duration::from_secs(1));
        let restart = Restart { policy: RestartPolicy::Always, backoff: ms(10), at_most: 1000, within: second };
        for life in [ms(0), ms(5), ms(300), ms(1200), ms(9000)] {
            let mut policy = Policy::new(restart);
            let mut now = Instant::now();
            let mut pauses = Vec::new();
            for _ in 0..20 {
                now += life;
                let Next::Again(pause) = policy.ended(false, now) else { panic!("a router is never given up") };
                pauses.push(pause);
                now += pause;
            }
            assert_eq!(pauses[0], ms(10));
            assert_eq!(policy.in_a_row(), 20);
            assert!(pauses.is_sorted() && pauses[7..].iter().all(|pause| *pause == second), "{life:?}: {pauses:?}");
            assert_eq!(policy.ended(false, now + STEADY + second * 2), Next::Again(ms(10)), "it worked for long");
            assert_eq!(policy.in_a_row(), 1);
        }
    }
}
