//! The clocks of a simulated computer: a monotonic one that runs a little fast or slow, and CLOCK_REALTIME, which may be set.

/// Both clocks at one moment, and the truth, which no core may see.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Now {
    /// The simulation's own time, ns.
    pub true_ns: u64,
    /// The computer's CLOCK_MONOTONIC, ns.
    pub monotonic_ns: u64,
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
    realtime_less_monotonic_ns: i64,
}

impl Clock {
    /// A clock that shows `monotonic_ns` and `realtime_ns` at true time 0.
    pub fn new(monotonic_ns: u64, realtime_ns: u64, rate_ppb: i64) -> Self {
        let realtime_less_monotonic_ns = realtime_ns.wrapping_sub(monotonic_ns).cast_signed();
        Self { true_ns: 0, monotonic_ns, rate_ppb, realtime_less_monotonic_ns }
    }

    /// What it shows at a true time that is not before the last change of its rate.
    pub fn at(&self, true_ns: u64) -> Now {
        let since = i128::from(true_ns - self.true_ns);
        let fast = since * i128::from(self.rate_ppb) / BILLION;
        let monotonic_ns = (i128::from(self.monotonic_ns) + since + fast) as u64;
        Now { true_ns, monotonic_ns, realtime_ns: monotonic_ns.wrapping_add_signed(self.realtime_less_monotonic_ns) }
    }

    /// The true time at which it shows at least `monotonic_ns`, not before `true_ns`.
    pub fn when(&self, monotonic_ns: u64, true_ns: u64) -> u64 {
        let wait = i128::from(monotonic_ns.saturating_sub(self.at(true_ns).monotonic_ns));
        let slow = wait * i128::from(-self.rate_ppb) / BILLION;
        // Two roundings are less than 2 ns, and the square of the rate is less than a millionth of the wait.
        let rounding = if wait > 0 { 2 + wait / 1_000_000 } else { 0 };
        u64::try_from(i128::from(true_ns) + wait + slow + rounding).unwrap_or(u64::MAX)
    }

    /// How much it runs fast, ns a second.
    pub fn rate_ppb(&self) -> i64 {
        self.rate_ppb
    }

    /// From now on it runs so much fast.
    pub fn set_rate(&mut self, true_ns: u64, rate_ppb: i64) {
        self.monotonic_ns = self.at(true_ns).monotonic_ns;
        self.true_ns = true_ns;
        self.rate_ppb = rate_ppb;
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
