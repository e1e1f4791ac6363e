//! Time of a node that no master's Sync reaches: it follows the answers of the TCP router, and knows its error bound.
//!
//! Delays through a stream are long and uneven. So the rate of the clock is not measured: the line continues at the
//! pace of the local clock, and is slewed when an answer is more exact than it is.

use super::RATE_MAX_PPB;
use super::clock_model::{ClockModel, EVEN_PPB};
use rohrpost_mailbox::TimeRecord;

/// The first answers are often slow; the line begins after this many.
const HEARD_MIN: u8 = 4;
/// The line is slewed to an answer within this time, or longer if that would be too fast.
const SLEW_NS: u64 = 2_000_000_000;

/// The node's estimate of system time.
#[derive(Debug)]
pub struct Follower {
    line: ClockModel,
    /// Answers since the line has another epoch than they.
    heard: u8,
    /// Number of answers at the last look.
    answers: u64,
    /// The last record that the line was compared with.
    last: Option<TimeRecord>,
}

impl Follower {
    /// Continues the page of an earlier incarnation; else begins with the wall clock, with unknown error.
    pub fn new(now_ns: u64, wall_ns: u64, page: Option<TimeRecord>) -> Self {
        let line = match page {
            Some(page) if page.error_ns < super::UNSYNCHRONISED_NS => ClockModel::adopted(now_ns, page),
            Some(page) => ClockModel::unsynchronised(now_ns, page.at(now_ns).ns, page.epoch),
            None => ClockModel::unsynchronised(now_ns, wall_ns, 0),
        };
        Self { line, heard: 0, answers: 0, last: None }
    }

    /// The content of the page.
    pub fn record(&self) -> &TimeRecord {
        self.line.record()
    }

    /// Takes the best record after this many answers. It may stay the same for long, since the best one counts.
    pub fn told(&mut self, now_ns: u64, told: &TimeRecord, answers: u64) {
        self.line.end_slew(now_ns);
        let is_new = std::mem::replace(&mut self.answers, answers) != answers;
        let there = told.at(now_ns);
        let error_ns = u64::try_from(there.error.as_nanos()).unwrap_or(u64::MAX);
        let drift_ns_s = RATE_MAX_PPB.unsigned_abs();
        if self.line.is_synchronised() && told.epoch == self.line.record().epoch {
            self.heard = 0;
            if self.last.replace(*told) == Some(*told) {
                return;
            }
            let by_ns = there.ns.wrapping_sub(self.line.at(now_ns).ns).cast_signed();
            let whole_ns = error_ns.saturating_add(by_ns.unsigned_abs());
            if by_ns.unsigned_abs() > error_ns.saturating_add(self.line.error_ns(now_ns)) {
                return self.distrusts(now_ns);
            }
            // The line continues where it is more exact.
            if whole_ns < self.line.error_ns(now_ns) {
                self.line.bend(now_ns, by_ns, SLEW_NS, EVEN_PPB, whole_ns, drift_ns_s);
            }
            return;
        }
        self.heard += u8::from(is_new);
        if self.heard >= HEARD_MIN {
            self.heard = 0;
            self.line.step(now_ns, told.epoch, there.ns, EVEN_PPB, error_ns, drift_ns_s);
        }
    }

    /// The local clock broke its limits, or two contradictory times were received: the time is unknown, and it begins
    /// anew.
    pub fn distrusts(&mut self, now_ns: u64) {
        self.line = ClockModel::unsynchronised(now_ns, self.line.at(now_ns).ns, 0);
        (self.heard, self.last) = (0, None);
    }

    /// No answer comes.
    pub fn goes_on(&mut self, now_ns: u64) {
        self.line.end_slew(now_ns);
    }

    /// The page was not written in time, and still has this record.
    pub fn page_says(&mut self, now_ns: u64, page: &TimeRecord) {
        self.line.go_on_from(now_ns, page);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::UNSYNCHRONISED_NS;
    use proptest::prelude::*;
    use rohrpost_mailbox::TimeSource;

    const SECOND_NS: u64 = 1_000_000_000;
    /// System time is so far ahead of the local clock, which is `fast_ppb` fast.
    const AHEAD_NS: u64 = 1_000 * SECOND_NS;

    fn truth(now_ns: u64, fast_ppb: i64) -> u64 {
        let gained_ns = i128::from(now_ns) * i128::from(fast_ppb) / 1_000_000_000;
        (AHEAD_NS + now_ns).wrapping_add_signed(-gained_ns as i64)
    }

    fn told(epoch: u64, now_ns: u64, system_ns: u64, error_ns: u64) -> TimeRecord {
        TimeRecord {
            epoch,
            source: TimeSource::Master,
            monotonic_ns: now_ns,
            system_ns,
            pace_ppb: EVEN_PPB,
            error_ns,
            drift_ns_s: RATE_MAX_PPB.unsigned_abs(),
        }
    }

    #[test]
    fn it_begins_when_it_has_heard_enough_and_steps_with_the_epoch() {
        let mut follower = Follower::new(0, 5, None);
        // The first exchange is the best of all, so the record stays the same while answers come.
        let best = told(7, 1, AHEAD_NS + 1, 1_000);
        for answers in 1..u64::from(HEARD_MIN) {
            follower.told(answers, &best, answers);
            follower.told(answers, &best, answers);
            assert_eq!(follower.record().error_ns, UNSYNCHRONISED_NS, "an answer counts once");
        }
        follower.told(9, &best, u64::from(HEARD_MIN));
        assert_eq!((follower.record().epoch, follower.record().at(9).ns), (7, AHEAD_NS + 9));
        for now_ns in 10..10 + u64::from(HEARD_MIN) {
            assert_eq!(follower.record().epoch, 7);
            follower.told(now_ns, &told(3, now_ns, 2 * AHEAD_NS, 1_000), now_ns);
        }
        assert_eq!(follower.record().epoch, 3, "a network that began anew has a lower one");
        let again = Follower::new(20, 5, Some(*follower.record()));
        let there = again.record().at(20);
        assert_eq!(
            (there.epoch, there.ns),
            (3, follower.record().at(20).ns + 1),
            "a client that is started again goes on"
        );
    }

    #[test]
    fn two_times_that_cannot_both_be_true_are_a_contradiction_and_no_choice() {
        let mut follower = Follower::new(0, 5, None);
        let begin = |follower: &mut Follower, from_ns: u64, ahead_ns: u64, answers: u64| {
            (0..u64::from(HEARD_MIN)).for_each(|n| {
                let now_ns = from_ns + n;
                follower.told(now_ns, &told(7, now_ns, now_ns + ahead_ns, 10_000_000), answers + n);
            });
        };
        begin(&mut follower, 100, AHEAD_NS, 1);
        assert!(follower.record().error_ns < UNSYNCHRONISED_NS);
        // The computer slept for an hour, and its clock stopped meanwhile.
        let ahead_ns = AHEAD_NS + 3_600 * SECOND_NS;
        follower.told(SECOND_NS, &told(7, SECOND_NS, SECOND_NS + ahead_ns, 10_000_000), 9);
        assert_eq!((follower.record().epoch, follower.record().error_ns), (0, UNSYNCHRONISED_NS), "nothing is known");
        begin(&mut follower, 2 * SECOND_NS, ahead_ns, 10);
        let there = follower.record().at(3 * SECOND_NS);
        assert_eq!((there.epoch, there.ns), (7, 3 * SECOND_NS + ahead_ns));
    }

    proptest! {
        #[test]
        fn time_never_goes_back_and_its_bound_holds(
            fast_ppb in -200_000i64..200_000,
            answers in prop::collection::vec((10_000_000u64..3 * SECOND_NS, 0u64..20_000_000, any::<bool>()), 1..40),
        ) {
            let mut follower = Follower::new(0, 0, None);
            let (mut now_ns, mut last_ns) = (0, 0);
            for ((pause_ns, off_ns, early), count) in answers.into_iter().zip(1..) {
                // Between two answers the line is read, as readers do.
                for _ in 0..10 {
                    now_ns += pause_ns / 10;
                    let there = follower.record().at(now_ns);
                    if follower.record().error_ns < UNSYNCHRONISED_NS {
                        prop_assert!(there.ns >= last_ns, "back by {} ns", last_ns - there.ns);
                        last_ns = there.ns;
                        let off_ns = there.ns.abs_diff(truth(now_ns, fast_ppb));
                        prop_assert!(u128::from(off_ns) <= there.error.as_nanos(), "{off_ns} ns off: {there:?}");
                    }
                }
                let system_ns = truth(now_ns, fast_ppb);
                let said_ns = if early { system_ns - off_ns } else { system_ns + off_ns };
                follower.told(now_ns, &told(1, now_ns, said_ns, off_ns + 10), count);
            }
        }
    }
}
