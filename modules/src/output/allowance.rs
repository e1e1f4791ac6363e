//! How much a module may say, and the count of what it said beyond that. No clock: time comes as an argument, in
//! nanoseconds of the monotonic one. No lock: threads of a module say things at the same time.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

const SECOND_NS: u64 = 1_000_000_000;
/// When nothing was suppressed for so long, the module is quieter again, and is told of.
const QUIET_NS: u64 = SECOND_NS / 2;
/// A flood that goes on is told of so often.
const LATEST_NS: u64 = 5 * SECOND_NS;

/// Limits lines: a number a second, and a burst after a pause.
///
/// It is a bucket of tokens, seen from the other side: the time at which it will be full again says how many are
/// missing (the generic cell rate algorithm). So one number is all of it, and taking is one compare-and-swap.
pub struct Bucket {
    /// A token drips in so often.
    interval_ns: u64,
    /// How far in the future it may be full for one token to be left.
    room_ns: u64,
    full_at_ns: AtomicU64,
}

impl Bucket {
    /// So many lines a second, and so many at once.
    pub fn new(rate_per_s: u32, burst: u32) -> Self {
        let interval_ns = SECOND_NS / u64::from(rate_per_s.max(1));
        let room_ns = interval_ns * u64::from(burst.max(1) - 1);
        Self { interval_ns, room_ns, full_at_ns: AtomicU64::new(0) }
    }

    /// Takes a token; false when there is none.
    pub fn take(&self, now_ns: u64) -> bool {
        let next = |full_at_ns: u64| {
            let full_at_ns = full_at_ns.max(now_ns);
            (full_at_ns - now_ns <= self.room_ns).then_some(full_at_ns + self.interval_ns)
        };
        // Relaxed: nothing else is read by what is found here.
        self.full_at_ns.fetch_update(Ordering::Relaxed, Ordering::Relaxed, next).is_ok()
    }
}

/// What was suppressed since it was last told.
#[derive(Default)]
pub(super) struct Excess {
    count: AtomicU32,
    /// 0: nothing to tell.
    first_ns: AtomicU64,
    last_ns: AtomicU64,
}

/// What there is to tell.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Suppressed {
    pub(super) lines: u32,
    /// From the first to the last of them.
    pub(super) within: Duration,
}

impl Excess {
    /// Counts one; true when it is the first.
    pub(super) fn add(&self, now_ns: u64) -> bool {
        self.last_ns.fetch_max(now_ns, Ordering::Relaxed);
        // ORDERING: counts, then looks at `first_ns`, while `tell_all` empties `first_ns`, then takes the count.
        // SeqCst, so that not both miss the other: a count that nobody tells of.
        self.count.fetch_add(1, Ordering::SeqCst);
        self.first_ns.compare_exchange(0, now_ns.max(1), Ordering::SeqCst, Ordering::SeqCst).is_ok()
    }

    /// When [`tell`](Self::tell) will have something to say.
    pub(super) fn due_ns(&self) -> Option<u64> {
        let first_ns = self.first_ns.load(Ordering::Relaxed);
        let quiet_ns = self.last_ns.load(Ordering::Relaxed) + QUIET_NS;
        (first_ns > 0).then(|| quiet_ns.min(first_ns + LATEST_NS))
    }

    /// What is to be told by now; each is told once, by whichever thread asks first.
    pub(super) fn tell(&self, now_ns: u64) -> Option<Suppressed> {
        if self.due_ns()? > now_ns {
            return None;
        }
        self.tell_all()
    }

    /// The same, whether it is time or not: the module ends.
    pub(super) fn tell_all(&self) -> Option<Suppressed> {
        // ORDERING: see `add`.
        let first_ns = self.first_ns.swap(0, Ordering::SeqCst);
        if first_ns == 0 {
            return None;
        }
        // One that is counted between these two lines is told of now, and found to be none when its own time comes.
        let lines = self.count.swap(0, Ordering::SeqCst);
        let within = self.last_ns.load(Ordering::Relaxed).saturating_sub(first_ns);
        (lines > 0).then_some(Suppressed { lines, within: Duration::from_nanos(within) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_burst_then_one_for_each_interval() {
        let bucket = Bucket::new(100, 3);
        let start = 7 * SECOND_NS;
        for (at_ms, taken, why) in [
            (0, true, "it begins full"),
            (0, true, "the second of three"),
            (0, true, "the third"),
            (0, false, "empty"),
            (9, false, "a token takes 10 ms"),
            (10, true, "the first that dripped in"),
            (10, false, "and no other"),
            (5, false, "a thread that read the clock earlier gets none for that"),
            (1_000, true, "after a pause it is full"),
            (1_000, true, "full"),
            (1_000, true, "full"),
            (1_000, false, "but never fuller"),
        ] {
            assert_eq!(bucket.take(start + at_ms * MS), taken, "at {at_ms} ms: {why}");
        }
    }

    #[test]
    fn the_least_and_the_most_that_configuration_allows() {
        let slow = Bucket::new(1, 1);
        assert!(slow.take(0) && !slow.take(SECOND_NS - 1) && slow.take(SECOND_NS));
        let fast = Bucket::new(1_000_000, 100_000);
        assert_eq!((0..200_000).filter(|_| fast.take(SECOND_NS)).count(), 100_000);
    }

    /// For any arrivals: in no stretch of time do more pass than the burst and the rate allow, and none is refused
    /// while a token by token account has one left.
    #[test]
    fn no_stretch_of_time_has_more_than_its_share() {
        for seed in 0..500 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let (rate, burst) = (random.random_range(1..2_000), random.random_range(1..300));
            let bucket = Bucket::new(rate, burst);
            let interval_ns = SECOND_NS / u64::from(rate);
            let mut now_ns = random.random_range(0..u64::MAX / 2);
            let mut passed: Vec<u64> = Vec::new();
            // The account: tokens in nanoseconds of dripping.
            let full_ns = interval_ns * u64::from(burst);
            let (mut account_ns, mut before_ns) = (full_ns, now_ns);
            for _ in 0..2_000 {
                now_ns += if random.random_bool(0.02) {
                    random.random_range(0..2 * SECOND_NS)
                } else {
                    random.random_range(0..interval_ns)
                };
                account_ns = full_ns.min(account_ns + (now_ns - before_ns));
                before_ns = now_ns;
                let may = account_ns >= interval_ns;
                assert_eq!(bucket.take(now_ns), may, "seed {seed}, {rate} a second, {burst} at once");
                if may {
                    account_ns -= interval_ns;
                    passed.push(now_ns);
                }
            }
            for pair in passed.windows(burst as usize + 1) {
                let stretch_ns = pair[burst as usize] - pair[0];
                assert!(stretch_ns >= interval_ns, "seed {seed}: {} within {stretch_ns} ns", burst + 1);
            }
        }
    }

    #[test]
    fn an_excess_is_told_once_when_it_is_quiet_or_goes_on_for_long() {
        let excess = Excess::default();
        let start = 3 * SECOND_NS;
        assert_eq!((excess.due_ns(), excess.tell(start), excess.tell_all()), (None, None, None));
        assert!(excess.add(start), "the first wakes the thread that tells");
        assert!(!excess.add(start + 100 * MS));
        assert_eq!(excess.due_ns(), Some(start + 600 * MS));
        assert_eq!(excess.tell(start + 599 * MS), None);
        let told = Suppressed { lines: 2, within: Duration::from_millis(100) };
        assert_eq!(excess.tell(start + 600 * MS), Some(told));
        assert_eq!(excess.tell(start + 600 * MS), None);

        // A flood without a pause.
        for ms in 0..4_999 {
            excess.add(start + ms * MS);
            assert_eq!(excess.tell(start + ms * MS), None, "at {ms} ms");
        }
        let told = excess.tell(start + 5_000 * MS).unwrap();
        assert_eq!((told.lines, told.within), (4_999, Duration::from_millis(4_998)));
        excess.add(start);
        assert_eq!(excess.tell_all().map(|told| told.lines), Some(1), "at its end a module waits for nothing");
    }

    /// However adding and telling fall together, what is told is what was added.
    #[test]
    fn threads_lose_no_count() {
        let excess = Excess::default();
        let each = 50_000;
        let told = std::thread::scope(|scope| {
            let adders: Vec<_> = (0..3).map(|_| scope.spawn(|| (1..=each).for_each(|n| _ = excess.add(n)))).collect();
            let mut told = 0;
            while adders.iter().any(|adder| !adder.is_finished()) {
                told += excess.tell_all().map_or(0, |told| told.lines);
            }
            told + excess.tell_all().map_or(0, |told| told.lines)
        });
        assert_eq!(u64::from(told), 3 * each);
    }
}
