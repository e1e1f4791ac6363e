//! How much of a processor the clock's thread may use. It has the highest priority, and it reads each datagram that
//! bears the address of a node, forged or not.

/// It may use one part in this many of all time.
const PARTS: u64 = 10;
/// What it did not use it may use later, up to so much, ns: all that comes at once in quiet times.
const SAVED_NS_MAX: u64 = 2_000_000;
/// Used up, it leaves what comes in its socket until it has saved so much again, ns.
const RESUMES_NS: u64 = 200_000;
/// Longest time that counts as work, ns: in a longer one the thread stood still.
const USED_NS_MAX: u64 = 1_000_000;

/// Processor time that the clock's thread has left.
#[derive(Debug)]
pub(super) struct CpuBudget {
    /// Less than 0: it used more than it had.
    saved_ns: i64,
    since_ns: u64,
    is_used_up: bool,
}

impl CpuBudget {
    pub(super) fn new(now_ns: u64) -> Self {
        Self { saved_ns: SAVED_NS_MAX.cast_signed(), since_ns: now_ns, is_used_up: false }
    }

    /// The thread has worked from then to then.
    pub(super) fn uses(&mut self, from_ns: u64, to_ns: u64) {
        self.saves(to_ns);
        let used_ns = to_ns.saturating_sub(from_ns).min(USED_NS_MAX).cast_signed();
        self.saved_ns -= used_ns;
        self.is_used_up |= self.saved_ns <= 0;
    }

    /// End of the time in which it reads nothing, ns; none if it may read.
    pub(super) fn rests_until_ns(&mut self, now_ns: u64) -> Option<u64> {
        self.saves(now_ns);
        let lacks_ns = RESUMES_NS.cast_signed() - self.saved_ns;
        self.is_used_up &= lacks_ns > 0;
        self.is_used_up.then(|| now_ns + lacks_ns.unsigned_abs() * PARTS)
    }

    fn saves(&mut self, now_ns: u64) {
        let passed_ns = now_ns.saturating_sub(self.since_ns);
        if passed_ns >= PARTS {
            self.saved_ns = (self.saved_ns + (passed_ns / PARTS).cast_signed()).min(SAVED_NS_MAX.cast_signed());
            self.since_ns = now_ns - passed_ns % PARTS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_flooded_thread_works_a_tenth_of_the_time_and_others_never_rest() {
        let (mut share, mut now_ns, mut worked_ns) = (CpuBudget::new(0), 0, 0);
        while now_ns < 1_000 * MS {
            match share.rests_until_ns(now_ns) {
                Some(until_ns) => now_ns = until_ns,
                None => {
                    share.uses(now_ns, now_ns + 70_000);
                    (now_ns, worked_ns) = (now_ns + 70_000, worked_ns + 70_000);
                }
            }
        }
        assert!((99 * MS..104 * MS).contains(&worked_ns), "{worked_ns} of {now_ns}");
        let mut quiet = CpuBudget::new(0);
        for round in 1..10_000 {
            assert_eq!(quiet.rests_until_ns(round * MS), None);
            quiet.uses(round * MS, round * MS + 80_000);
        }
    }
}
