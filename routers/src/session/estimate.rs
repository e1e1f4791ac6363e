//! Time by questions and answers: how far the server's clocks are from ours, and how far off that is at most.
//!
//! ```text
//!  server            came ──────── left
//!                   ╱                  ╲              the two ways together took (heard - asked) - (left - came);
//!  client      asked                    heard         nobody knows how they share it, so half of it is the bound
//! ```
//!
//! A stream has no time of arrival: what waits in a buffer makes a way longer, never shorter. So the shortest exchange
//! counts most, until its age makes it worse than a later one.

use super::frame::TimeAnswer;
use crate::time::RATE_MAX_PPB;
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, TimeRecord, TimeSource};

/// Exchanges that are kept.
const KEPT: usize = 8;
const BILLION: u128 = 1_000_000_000;

/// A moment, and how far off it is at most.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bounded {
    /// Ns of the clock that was asked for.
    pub ns: u64,
    /// At most so far off, ns.
    pub error_ns: u64,
}

/// What one client knows of the clocks of one incarnation of the server.
#[derive(Clone, Debug, Default)]
pub struct ServerClockEstimate {
    kept: [Option<RoundTripSample>; KEPT],
    next: usize,
    /// Answers that were read.
    answers: u64,
}

#[derive(Clone, Copy, Debug)]
struct RoundTripSample {
    answer: TimeAnswer,
    /// Our clock when it was read, ns.
    heard_ns: u64,
    /// Both ways together, ns.
    ways_ns: u64,
}

impl RoundTripSample {
    /// How far off the server's session clock may be by now, ns.
    fn error_ns(&self, now_ns: u64) -> u64 {
        let age_ns = now_ns.saturating_sub(self.heard_ns) + self.ways_ns;
        let drift_ns = u128::from(age_ns) * u128::from(RATE_MAX_PPB.unsigned_abs()) / BILLION;
        let ways_ns = self.ways_ns.div_ceil(2);
        ways_ns + drift_ns as u64 + 1
    }

    /// The server's session clock by this exchange, ns.
    fn session_ns(&self, now_ns: u64) -> u64 {
        let heard_ns = self.answer.left_ns.saturating_add(self.ways_ns / 2);
        heard_ns.saturating_add(now_ns.saturating_sub(self.heard_ns))
    }
}

impl ServerClockEstimate {
    /// An answer was read. False: it answers nothing that was asked before.
    pub fn heard(&mut self, now_ns: u64, answer: &TimeAnswer) -> bool {
        let there_ns = answer.left_ns - answer.came_ns;
        let Some(ways_ns) = now_ns.checked_sub(answer.asked_ns) else { return false };
        // Clocks of different pace may make the way seem shorter than nothing.
        let sample = RoundTripSample { answer: *answer, heard_ns: now_ns, ways_ns: ways_ns.saturating_sub(there_ns) };
        if self.contradicts(now_ns, &sample) {
            self.forget();
        }
        self.kept[self.next] = Some(sample);
        self.next = (self.next + 1) % KEPT;
        self.answers += 1;
        true
    }

    /// What was heard does not count any more: a clock did what bounds exclude.
    pub fn forget(&mut self) {
        self.kept = [None; KEPT];
    }

    /// Whether one that is kept and this one cannot both be true: one of both ends slept, or was slewed.
    fn contradicts(&self, now_ns: u64, sample: &RoundTripSample) -> bool {
        let mut kept = self.kept.iter().flatten();
        kept.any(|other| {
            let apart_ns = other.session_ns(now_ns).abs_diff(sample.session_ns(now_ns));
            apart_ns > other.error_ns(now_ns).saturating_add(sample.error_ns(now_ns))
        })
    }

    /// How many answers were read.
    pub fn answers(&self) -> u64 {
        self.answers
    }

    /// The shortest round trip of those that are kept, ns.
    pub fn round_trip_ns(&self) -> Option<u64> {
        self.kept.iter().flatten().map(|sample| sample.ways_ns).min()
    }

    /// The server's session clock.
    pub fn session(&self, now_ns: u64) -> Option<Bounded> {
        let best = self.kept.iter().flatten().min_by_key(|sample| sample.error_ns(now_ns))?;
        Some(Bounded { ns: best.session_ns(now_ns), error_ns: best.error_ns(now_ns) })
    }

    /// System time as the server has it, as of the best exchange: of the latest epoch. None if it does not know it.
    pub fn system(&self, now_ns: u64) -> Option<TimeRecord> {
        let known = || self.kept.iter().flatten().filter(|sample| sample.answer.error_ns < ERROR_UNKNOWN_NS);
        let epoch = known().map(|sample| sample.answer.epoch).max()?;
        let whole_error_ns = |sample: &RoundTripSample| sample.error_ns(now_ns).saturating_add(sample.answer.error_ns);
        let best = known().filter(|sample| sample.answer.epoch == epoch).min_by_key(|sample| whole_error_ns(sample))?;
        Some(TimeRecord {
            epoch,
            source: TimeSource::Master,
            monotonic_ns: best.heard_ns,
            system_ns: best.answer.system_ns.saturating_add(best.ways_ns / 2),
            pace_ppb: BILLION as u64,
            error_ns: best.error_ns(best.heard_ns).saturating_add(best.answer.error_ns).min(ERROR_UNKNOWN_NS),
            drift_ns_s: RATE_MAX_PPB.unsigned_abs(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The server's clock is 5 s ahead and its system time 1000 s; both ways take `there` and `back`.
    fn exchange(asked_ns: u64, there: u64, back: u64) -> (u64, TimeAnswer) {
        let (came_ns, left_ns) = (asked_ns + there + 5_000_000_000, asked_ns + there + 5_000_000_100);
        let system_ns = left_ns + 995_000_000_000;
        let answer = TimeAnswer { asked_ns, came_ns, left_ns, system_ns, error_ns: 10, epoch: 3 };
        (asked_ns + there + 100 + back, answer)
    }

    #[test]
    fn the_true_time_lies_within_the_bound_however_unequal_the_ways_are() {
        for (there, back) in [(1000, 1000), (0, 1_000_000), (1_000_000, 0), (3, 70_000)] {
            let mut estimate = ServerClockEstimate::default();
            let (heard_ns, answer) = exchange(10_000, there, back);
            assert!(estimate.heard(heard_ns, &answer));
            let now_ns = heard_ns + 2_000_000_000;
            let session = estimate.session(now_ns).unwrap();
            assert!(session.ns.abs_diff(now_ns + 5_000_000_000) <= session.error_ns, "{there}, {back}: {session:?}");
            let system = estimate.system(now_ns).unwrap().at(now_ns);
            let off_ns = system.ns.abs_diff(now_ns + 1_000_000_000_000);
            assert!(u128::from(off_ns) <= system.error.as_nanos(), "{there}, {back}: {system:?}");
            assert_eq!(system.epoch, 3);
        }
    }

    #[test]
    fn the_shortest_exchange_counts_until_it_is_old() {
        let mut estimate = ServerClockEstimate::default();
        for (asked_ns, way) in [(0, 500_000), (1_000_000, 10_000), (2_000_000, 400_000)] {
            let (heard_ns, answer) = exchange(asked_ns, way, way);
            estimate.heard(heard_ns, &answer);
        }
        assert_eq!(estimate.answers(), 3, "also those that are worse than the best");
        assert!(estimate.session(3_000_000).unwrap().error_ns < 12_000, "that of 10 µs each way");
        let (heard_ns, answer) = exchange(20_000_000_000, 400_000, 400_000);
        estimate.heard(heard_ns, &answer);
        let error_ns = estimate.session(heard_ns).unwrap().error_ns;
        assert!((400_000..402_000).contains(&error_ns), "clocks drift 5 ms in 20 s: {error_ns}");
    }

    #[test]
    fn what_cannot_all_be_true_is_a_contradiction_and_the_latest_counts() {
        let mut estimate = ServerClockEstimate::default();
        for asked_ns in [0, 1_000_000_000] {
            let (heard_ns, answer) = exchange(asked_ns, 10_000, 10_000);
            estimate.heard(heard_ns, &answer);
        }
        // This computer slept for an hour, and its clock stood still; the way there is a slow one now.
        let (heard_ns, mut answer) = exchange(2_000_000_000, 400_000, 400_000);
        let slept_ns = 3_600_000_000_000;
        for ns in [&mut answer.came_ns, &mut answer.left_ns, &mut answer.system_ns] {
            *ns += slept_ns;
        }
        estimate.heard(heard_ns, &answer);
        let system = estimate.system(heard_ns).unwrap().at(heard_ns);
        assert!(system.ns.abs_diff(heard_ns + 1_000_000_000_000 + slept_ns) <= 400_000, "{system:?}");
        assert_eq!(estimate.answers(), 3);
    }

    #[test]
    fn an_answer_to_a_question_of_the_future_is_none() {
        let (_, answer) = exchange(10_000, 5, 5);
        let mut estimate = ServerClockEstimate::default();
        assert!(!estimate.heard(9_999, &answer));
        assert_eq!(estimate.answers(), 0);
    }
}
