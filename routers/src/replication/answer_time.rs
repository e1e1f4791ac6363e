//! How long an answer takes, and how often a replica asks.

use super::gathering::Life;

/// Before the first answer: a few round trips of a quiet LAN.
const FIRST_NS: u64 = 10_000_000;
/// Both threads wake up and run in this time, on a computer that is not busy.
const LEAST_NS: u64 = 2_000_000;
/// Longer than the cycle of time slots, and than most round trips of a radio.
const MOST_NS: u64 = 100_000_000;
/// A replica asks this often in the long run, ns: 500 requests a second.
const ASK_EVERY_NS: u64 = 2_000_000;
/// And so many at once.
const ASK_BURST: u64 = 32;

/// So many requests without an answer are not all lost: the answer takes longer than is waited.
const REQUESTS_LOST_MAX: u32 = 4;

/// The time from a request to the part that it asks for, by the answers so far: smoothed as TCP does (RFC 6298). Which
/// of several requests an answer is for is not known, so it says nothing (Karn's algorithm), unless it is the first answer
/// of all, or to very many: then it counts as one to the first request, which is too long at worst.
#[derive(Debug, Default)]
pub(super) struct AnswerTime {
    /// 0: no answer yet.
    mean_ns: u64,
    spread_ns: u64,
    /// As of the requests so far, the next one is due, ns.
    next_ns: u64,
}

/// A request of which nothing came while that mattered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unanswered {
    pub(super) life: Life,
    pub(super) sequence: u64,
    /// When that was asked for first, ns.
    pub(super) asked_ns: u64,
    pub(super) requests: u32,
}

impl Unanswered {
    /// Whether an answer may still come that says something.
    pub(super) fn is_awaited(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.asked_ns) <= MOST_NS
    }
}

impl AnswerTime {
    /// An answer came so long after the first of so many requests for it.
    pub(super) fn answered(&mut self, took_ns: u64, requests: u32) {
        if self.mean_ns > 0 && (2..=REQUESTS_LOST_MAX).contains(&requests) {
            return;
        }
        let took_ns = took_ns.clamp(1, MOST_NS);
        if self.mean_ns == 0 {
            (self.mean_ns, self.spread_ns) = (took_ns, took_ns / 2);
            return;
        }
        self.spread_ns = (3 * self.spread_ns + self.mean_ns.abs_diff(took_ns)) / 4;
        self.mean_ns = ((7 * self.mean_ns + took_ns) / 8).max(1);
    }

    /// An answer that has not come after so long has been lost.
    pub(super) fn ns(&self) -> u64 {
        if self.mean_ns == 0 { FIRST_NS } else { (self.mean_ns + 4 * self.spread_ns).clamp(LEAST_NS, MOST_NS) }
    }

    /// Whether one more request may leave now; then it counts.
    pub(super) fn may_ask(&mut self, now_ns: u64) -> bool {
        if self.next_ns > now_ns.saturating_add((ASK_BURST - 1) * ASK_EVERY_NS) {
            return false;
        }
        self.next_ns = self.next_ns.max(now_ns) + ASK_EVERY_NS;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn it_follows_the_answers() {
        let mut time = AnswerTime::default();
        assert_eq!(time.ns(), FIRST_NS);
        for (took_ns, range) in [(6 * MS, 6 * MS..9 * MS), (200 * MS, 100 * MS..101 * MS), (0, LEAST_NS..LEAST_NS + 1)]
        {
            (0..100).for_each(|_| time.answered(took_ns, 1));
            assert!(range.contains(&time.ns()), "answers of {took_ns} ns: {} ns", time.ns());
        }
    }

    #[test]
    fn an_answer_to_several_requests_says_something_if_nothing_else_does() {
        let mut time = AnswerTime::default();
        time.answered(25 * MS, 2);
        assert!(time.ns() > 25 * MS, "the first one: {}", time.ns());
        (0..100).for_each(|_| time.answered(MS, 1));
        let before_ns = time.ns();
        time.answered(40 * MS, 2);
        assert_eq!(time.ns(), before_ns, "perhaps only a request was lost");
        time.answered(40 * MS, REQUESTS_LOST_MAX + 1);
        assert!(time.ns() > 20 * MS, "not so many: {}", time.ns());
    }

    #[test]
    fn requests_are_bounded() {
        let mut time = AnswerTime::default();
        let asked = |time: &mut AnswerTime, from: u64| (from..from + 1000).filter(|ms| time.may_ask(ms * MS)).count();
        assert_eq!(asked(&mut time, 0), 500 + ASK_BURST as usize - 1);
        assert_eq!((0..100).filter(|_| time.may_ask(5000 * MS)).count(), ASK_BURST as usize);
    }
}
