//! A computer's monotonic clock, which is too fast or too slow.

const MILLION: i64 = 1_000_000;

/// Shows `shown_ns` at the true time `true_ns`, and goes on at its own rate.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    pub(crate) true_ns: u64,
    pub(crate) shown_ns: u64,
    /// How much faster than true time, parts per million.
    pub(crate) error_ppm: i64,
}

impl Clock {
    pub(crate) fn at(&self, true_ns: u64) -> u64 {
        let gone_ns = (true_ns - self.true_ns) as i128 * i128::from(MILLION + self.error_ppm) / i128::from(MILLION);
        self.shown_ns + gone_ns as u64
    }

    /// The first true time at which it shows this, or `now_ns` if that is over.
    pub(crate) fn when(&self, now_ns: u64, shown_ns: u64) -> u64 {
        let rest_ns = i128::from(shown_ns.saturating_sub(self.at(now_ns)));
        now_ns + (rest_ns * i128::from(MILLION) / i128::from(MILLION + self.error_ppm)) as u64 + u64::from(rest_ns > 0)
    }

    /// From now on it has another rate.
    pub(crate) fn drift(&mut self, now_ns: u64, error_ppm: i64) {
        *self = Self { true_ns: now_ns, shown_ns: self.at(now_ns), error_ppm };
    }
}
