//! Whether the local clock keeps its [`LIMITS`]: by comparison with a clock that nothing slews, and with the time that
//! the computer has slept.
//!
//! ```text
//!  local less unslewed ▲            ┌ slewed: further off the line than the change that is allowed
//!                      │        .·'·'
//!                      │   ──·──·──·──·──   the line: what the rate of the last span says
//!                      └──────────────────▶
//! ```

use super::limits::LIMITS;
use rohrpost_mailbox::Watched;

/// The line is fitted anew after this long: readings are then exact to a few ppm.
const SPAN_NS: u64 = 100_000_000;
/// An unsteady clock is trusted again after this long without a new finding.
const STEADY_AFTER_NS: u64 = 3 * SPAN_NS;
const BILLION: i128 = 1_000_000_000;

/// The clocks of a computer at one moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Looked {
    /// The local clock, ns; it may be slewed.
    pub local_ns: u64,
    /// A clock that nothing slews, ns.
    pub unslewed_ns: u64,
    /// Longest time between the two readings, ns.
    pub apart_ns: u64,
    /// How long the computer has slept, ns.
    pub slept_ns: u64,
}

/// Why a clock is not trusted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Unsteady {
    /// The computer slept; its clocks do not know exactly how long.
    #[error("the computer slept for {} s", slept_ns / 1_000_000_000)]
    Slept {
        /// Approximate.
        slept_ns: u64,
    },
    /// Shortly before this router was started, its earlier incarnation found one of the others.
    #[error("shortly before this router was started the computer slept, or its clock was slewed")]
    Before,
    /// A time daemon slews it.
    #[error(
        "its clock is slewed, by {} ppm: end the time daemon of this computer (`rohrpost doctor` names it)",
        rate_ppb / 1_000
    )]
    Slewed {
        /// How much faster than its oscillator, ns a second.
        rate_ppb: i64,
    },
}

/// Observed state.
#[derive(Debug, Default)]
pub(crate) struct Steadiness {
    /// Where the present span began.
    began: Option<Looked>,
    /// How much faster than its oscillator the clock was in the last span, ns a second.
    rate_ppb: Option<i64>,
    slept_ns: Option<u64>,
    /// Until when the clock is not trusted, local ns; and why.
    until_ns: u64,
    why: Option<Unsteady>,
}

impl Steadiness {
    /// Continues from what an earlier incarnation observed.
    pub(crate) fn of(watched: Option<Watched>) -> Self {
        let Some(Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns: until_ns }) =
            watched
        else {
            return Self::default();
        };
        let began = Some(Looked { local_ns, unslewed_ns, apart_ns, slept_ns });
        Self { began, rate_ppb, slept_ns: Some(slept_ns), until_ns, why: Some(Unsteady::Before) }
    }

    /// State for the next incarnation.
    pub(crate) fn watched(&self) -> Option<Watched> {
        let Looked { local_ns, unslewed_ns, apart_ns, .. } = self.began?;
        let (slept_ns, rate_ppb, unsteady_until_ns) = (self.slept_ns?, self.rate_ppb, self.until_ns);
        Some(Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns })
    }

    /// Reads the clocks. Returns the fault, if this look shows one.
    pub(crate) fn look(&mut self, now: Looked) -> Option<Unsteady> {
        let found = self.slept(now).or_else(|| self.slewed(now));
        if found.is_some() {
            self.until_ns = now.local_ns.saturating_add(STEADY_AFTER_NS);
            self.why = found;
        }
        found
    }

    /// Why the clock is not trusted now, and until when; none if it is.
    pub(crate) fn why(&self, local_ns: u64) -> Option<(Unsteady, u64)> {
        self.why.filter(|_| local_ns < self.until_ns).map(|why| (why, self.until_ns))
    }

    fn slept(&mut self, now: Looked) -> Option<Unsteady> {
        let before_ns = self.slept_ns.replace(now.slept_ns)?;
        let slept_ns = now.slept_ns.saturating_sub(before_ns);
        if slept_ns < LIMITS.slept_ns {
            return None;
        }
        // The other clock stopped meanwhile.
        (self.began, self.rate_ppb) = (Some(now), None);
        Some(Unsteady::Slept { slept_ns })
    }

    fn slewed(&mut self, now: Looked) -> Option<Unsteady> {
        let began = *self.began.get_or_insert(now);
        let since_ns = i128::from(now.unslewed_ns.saturating_sub(began.unslewed_ns));
        let gained_ns = i128::from(now.local_ns) - i128::from(began.local_ns) - since_ns;
        let doubt_ns = i128::from(LIMITS.reading_ns + now.apart_ns + began.apart_ns);
        let expected_ns = since_ns * i128::from(self.rate_ppb.unwrap_or(0)) / BILLION;
        let change_ppb = if self.rate_ppb.is_some() { LIMITS.slewed_change_ppb } else { LIMITS.slewed_ppb };
        let is_off = (gained_ns - expected_ns).abs() > doubt_ns + since_ns * i128::from(change_ppb) / BILLION;
        let rate_ppb = (gained_ns * BILLION / since_ns.max(1)).clamp(i64::MIN.into(), i64::MAX.into()) as i64;
        if !is_off && since_ns < i128::from(SPAN_NS) {
            return None;
        }
        // The thread was held up between this reading and the next, so it says little: another comes.
        if is_off || now.apart_ns <= LIMITS.reading_ns {
            let is_known = since_ns >= i128::from(SPAN_NS);
            (self.began, self.rate_ppb) = (Some(now), if is_known { Some(rate_ppb) } else { None });
        }
        let is_fast = since_ns >= i128::from(SPAN_NS) && rate_ppb.abs() > LIMITS.slewed_ppb;
        (is_off || is_fast).then_some(Unsteady::Slewed { rate_ppb })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A clock that shows `slept_ns` more than the other, and is this fast.
    struct Computer {
        now: Looked,
        steadiness: Steadiness,
    }

    impl Computer {
        fn new() -> Self {
            Self { now: Looked { local_ns: 9, unslewed_ns: 5, ..Looked::default() }, steadiness: Steadiness::default() }
        }

        /// Looks every 5 ms for this long. Returns how long it took until something was found, ns.
        fn runs(&mut self, for_ns: u64, fast_ppb: i64) -> Option<(u64, Unsteady)> {
            for n in 1..=for_ns / (5 * MS) {
                self.now.unslewed_ns += 5 * MS;
                self.now.local_ns += (5 * MS).wrapping_add_signed(5 * fast_ppb / 1_000);
                self.now.apart_ns = 60 + n % 7 * 30;
                let late = Looked { local_ns: self.now.local_ns + n % 5 * 20, ..self.now };
                if let Some(found) = self.steadiness.look(late) {
                    return Some((n * 5 * MS, found));
                }
            }
            None
        }
    }

    #[test]
    fn what_a_daemon_corrects_for_good_is_steady_and_an_error_that_it_corrects_is_not() {
        for fast_ppb in [0, 104_000, -140_000] {
            let mut computer = Computer::new();
            assert_eq!(computer.runs(2_000 * MS, fast_ppb), None, "{fast_ppb} ppb for good");
            assert_eq!(computer.runs(2_000 * MS, fast_ppb + 10_000), None, "a little more");
            for (more_ppb, within_ms) in [(500_000, 10), (-500_000, 10), (80_000_000, 5), (100_000, 45), (60_000, 110)]
            {
                let (took_ns, why) =
                    computer.runs(2_000 * MS, fast_ppb + more_ppb).unwrap_or_else(|| panic!("{more_ppb}"));
                assert!(took_ns <= within_ms * MS, "{more_ppb} ppb more are found after {took_ns} ns");
                assert!(matches!(why, Unsteady::Slewed { .. }));
                assert!(computer.steadiness.why(computer.now.local_ns).is_some());
                computer.steadiness = Steadiness::default();
                assert_eq!(computer.runs(1_000 * MS, fast_ppb), None);
            }
        }
    }

    #[test]
    fn what_a_clock_did_while_nobody_watched_is_seen_by_the_next_life() {
        for (gained_ns, slept_ns, is_seen) in [(0, 0, false), (100_000, 0, true), (0, 100 * MS, true)] {
            let mut computer = Computer::new();
            assert_eq!(computer.runs(1_000 * MS, 100_000), None);
            computer.steadiness = Steadiness::of(computer.steadiness.watched());
            computer.now.unslewed_ns += 1_000 * MS;
            computer.now.local_ns += 1_000 * MS + 100_000 + gained_ns + slept_ns;
            computer.now.slept_ns += slept_ns;
            assert_eq!(computer.steadiness.look(computer.now).is_some(), is_seen, "{gained_ns}, {slept_ns}");
        }
        let mut slewed = Computer::new();
        assert!(slewed.runs(SPAN_NS, 300_000).is_some());
        let next = Steadiness::of(slewed.steadiness.watched());
        let now_ns = slewed.now.local_ns;
        assert_eq!(next.why(now_ns).map(|(why, _)| why), Some(Unsteady::Before), "the time daemon may go on");
        assert_eq!(next.why(now_ns + STEADY_AFTER_NS + MS), None);
        assert_eq!(Steadiness::of(None).watched(), None);
    }

    #[test]
    fn a_clock_that_is_slewed_for_long_is_unsteady_all_the_time_and_believed_soon_after() {
        let mut computer = Computer::new();
        computer.runs(1_000 * MS, 0);
        for _ in 0..10 {
            assert!(computer.runs(STEADY_AFTER_NS - SPAN_NS, 300_000).is_some(), "again and again");
        }
        while computer.runs(5 * MS, 0).is_some() {}
        let ends_ns = computer.now.local_ns + STEADY_AFTER_NS + SPAN_NS;
        while computer.steadiness.why(computer.now.local_ns).is_some() {
            computer.runs(5 * MS, 0);
            assert!(computer.now.local_ns <= ends_ns, "{:?}", computer.steadiness);
        }
        assert_eq!(computer.runs(1_000 * MS, 0), None);
    }

    #[test]
    fn a_computer_that_slept_is_not_believed_and_no_clock_of_it_is_called_slewed() {
        let mut computer = Computer::new();
        computer.runs(1_000 * MS, 20_000);
        computer.now.local_ns += 3_600_000 * MS;
        computer.now.slept_ns = 3_600_000 * MS;
        let (took_ns, why) = computer.runs(5 * MS, 20_000).unwrap();
        assert_eq!((took_ns, why), (5 * MS, Unsteady::Slept { slept_ns: 3_600_000 * MS }));
        assert!(why.to_string().contains("slept for 3600 s"));
        assert_eq!(computer.runs(1_000 * MS, 20_000), None);
    }
}
