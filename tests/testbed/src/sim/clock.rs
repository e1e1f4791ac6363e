//! The clocks of a simulated computer: a monotonic one that runs a little fast or slow, and CLOCK_REALTIME, which may
//! be set.

/// Both clocks at one moment, and the truth, which no core may see.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Now {
    /// The simulation's own time, ns.
    pub true_ns: u64,
    /// The computer's monotonic clock, which runs on while it sleeps, ns.
    pub monotonic_ns: u64,
    /// The one that nobody slews, and that stands still while it sleeps, ns.
    pub unslewed_ns: u64,
    /// For how long it has slept, as it says, ns.
    pub slept_ns: u64,
    /// Its CLOCK_REALTIME, ns since 1970.
    pub realtime_ns: u64,
}

const BILLION: i128 = 1_000_000_000;

/// The oscillator of one computer.
#[derive(Clone, Debug)]
pub struct Clock {
    /// Where the present rate began: true and monotonic time.
    true_ns: u64,
    monotonic_ns: u64,
    /// How much it runs fast, in ns a second.
    rate_ppb: i64,
    /// How much faster somebody makes it than its oscillator is, ns a second.
    slewed_ppb: i64,
    unslewed_ns: u64,
    slept_ns: u64,
    realtime_less_monotonic_ns: i64,
}

impl Clock {
    /// A clock that shows `monotonic_ns` and `realtime_ns` at true time 0.
    pub fn new(monotonic_ns: u64, realtime_ns: u64, rate_ppb: i64) -> Self {
        let realtime_less_monotonic_ns = realtime_ns.wrapping_sub(monotonic_ns).cast_signed();
        let (slewed_ppb, unslewed_ns, slept_ns) = (0, monotonic_ns, 0);
        Self { true_ns: 0, monotonic_ns, rate_ppb, slewed_ppb, unslewed_ns, slept_ns, realtime_less_monotonic_ns }
    }

    /// What it shows at a true time; before the last change of its rate, as if that had always been so.
    pub fn at(&self, true_ns: u64) -> Now {
        let since = i128::from(true_ns) - i128::from(self.true_ns);
        let fast = |ppb: i64| since * i128::from(ppb) / BILLION;
        let monotonic_ns = (i128::from(self.monotonic_ns) + since + fast(self.rate_ppb + self.slewed_ppb)) as u64;
        let unslewed_ns = (i128::from(self.unslewed_ns) + since + fast(self.rate_ppb)) as u64;
        let realtime_ns = monotonic_ns.wrapping_add_signed(self.realtime_less_monotonic_ns);
        Now { true_ns, monotonic_ns, unslewed_ns, slept_ns: self.slept_ns, realtime_ns }
    }

    /// The true time at which it shows at least `monotonic_ns`, not before `true_ns`.
    pub fn when(&self, monotonic_ns: u64, true_ns: u64) -> u64 {
        let wait = i128::from(monotonic_ns.saturating_sub(self.at(true_ns).monotonic_ns));
        let fast_ppb = i128::from(self.rate_ppb + self.slewed_ppb);
        let slow = -wait * fast_ppb / BILLION;
        // Two roundings are less than 2 ns; the square of the rate is less than a millionth of the wait, unless
        // somebody slews.
        let square = wait * fast_ppb / BILLION * fast_ppb / BILLION;
        let rounding = if wait > 0 { 2 + square.max(wait / 1_000_000) } else { 0 };
        u64::try_from(i128::from(true_ns) + wait + slow + rounding).unwrap_or(u64::MAX)
    }

    /// How much it runs fast, ns a second.
    pub fn rate_ppb(&self) -> i64 {
        self.rate_ppb
    }

    /// From now on it runs so much fast.
    pub fn set_rate(&mut self, true_ns: u64, rate_ppb: i64) {
        let now = self.at(true_ns);
        (self.monotonic_ns, self.unslewed_ns) = (now.monotonic_ns, now.unslewed_ns);
        self.true_ns = true_ns;
        self.rate_ppb = rate_ppb;
    }

    /// From now on somebody slews it by so much, ns a second.
    pub fn slew(&mut self, true_ns: u64, slewed_ppb: i64) {
        self.set_rate(true_ns, self.rate_ppb);
        self.slewed_ppb = slewed_ppb;
    }

    /// The computer wakes up: it has slept for so long until now, and what it takes for that is so much more.
    pub fn wakes(&mut self, true_ns: u64, slept_ns: u64, wrong_ns: i64) {
        self.set_rate(true_ns, self.rate_ppb);
        self.unslewed_ns -= slept_ns;
        self.slept_ns = (self.slept_ns + slept_ns).saturating_add_signed(wrong_ns);
        self.monotonic_ns = self.monotonic_ns.saturating_add_signed(wrong_ns);
    }

    /// Whether somebody slews it.
    pub fn is_slewed(&self) -> bool {
        self.slewed_ppb != 0
    }

    /// Somebody sets CLOCK_REALTIME.
    pub fn step_realtime(&mut self, by_ns: i64) {
        self.realtime_less_monotonic_ns += by_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_shows_what_its_rate_says_and_never_wakes_before_its_time() {
        let mut clock = Clock::new(5_000, 1_700_000_000_000_000_000, 50_000);
        assert_eq!(clock.at(0).monotonic_ns, 5_000);
        assert_eq!(clock.at(1_000_000_000).monotonic_ns, 1_000_055_000, "50 ppm fast");
        clock.set_rate(1_000_000_000, -200_000);
        clock.step_realtime(-3_000_000_000);
        let now = clock.at(2_000_000_000);
        assert_eq!(now.monotonic_ns, 1_999_855_000, "then 200 ppm slow");
        assert_eq!(now.realtime_ns, 1_699_999_998_999_850_000);
        for wait_ns in [0, 1, 999, 1_000_003, 7_000_000_001] {
            let want = now.monotonic_ns + wait_ns;
            let then = clock.when(want, now.true_ns);
            assert!(clock.at(then).monotonic_ns >= want, "{wait_ns}");
            assert!(clock.at(then).monotonic_ns <= want + 3 + wait_ns / 500_000, "{wait_ns}");
        }
    }
}
