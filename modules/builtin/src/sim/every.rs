//! Something that happens once a period of system time.

/// When it happens next.
pub(super) struct Every {
    period_ns: u64,
    next_ns: u64,
}

impl Every {
    pub(super) fn hz(rate_hz: f64) -> Self {
        Self { period_ns: period_ns(rate_hz), next_ns: 0 }
    }

    /// From the last time on, at another rate.
    pub(super) fn set_hz(&mut self, rate_hz: f64) {
        let last_ns = self.next_ns.saturating_sub(self.period_ns);
        self.period_ns = period_ns(rate_hz);
        self.next_ns = last_ns + self.period_ns;
    }

    /// Time is another one: it happens next at `now_ns`.
    pub(super) fn restart(&mut self, now_ns: u64) {
        self.next_ns = now_ns;
    }

    /// Whether it is time again.
    pub(super) fn is_due(&mut self, now_ns: u64) -> bool {
        if now_ns < self.next_ns {
            return false;
        }
        self.next_ns = (self.next_ns + self.period_ns).max(now_ns.saturating_sub(self.period_ns));
        true
    }
}

fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz) as u64
}
