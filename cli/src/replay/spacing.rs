//! How exactly a replay keeps the distances between values.

use rohrpost_mailbox::Latency;
use std::time::Duration;

/// Distances between values that were played one after the other, against the recorded ones at the same rate.
#[derive(Default)]
pub(super) struct Spacing {
    /// Of the last value: its arrival when it was recorded, and when it was played, by the computer's clock.
    last: Option<(u64, u64)>,
    errors: Latency,
}

impl Spacing {
    /// The next value has no distance to the last one: time stood still between them, or stepped, or changed its pace.
    pub(super) fn begin(&mut self) {
        self.last = None;
    }

    /// A value was played at this moment of the computer's clock.
    pub(super) fn note(&mut self, arrival_ns: u64, rate: f64, now_ns: u64) {
        let Some((last_arrival_ns, last_ns)) = self.last.replace((arrival_ns, now_ns)) else { return };
        let recorded_ns = arrival_ns.saturating_sub(last_arrival_ns) as f64 / rate;
        let error_ns = (now_ns.saturating_sub(last_ns) as f64 - recorded_ns).abs();
        self.errors.count_one(Duration::from_nanos(error_ns as u64));
    }

    /// The error that this share of the distances did not exceed, in nanoseconds.
    pub(super) fn quantile_ns(&self, share: f64) -> Option<u64> {
        self.errors.quantile(share).map(|error| error.as_nanos() as u64)
    }

    /// The largest error, in nanoseconds.
    pub(super) fn max_ns(&self) -> Option<u64> {
        (self.errors.count() > 0).then_some(self.errors.max.as_nanos() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_compared_at_the_rate_of_the_replay() {
        let mut spacing = Spacing::default();
        assert_eq!((spacing.quantile_ns(0.99), spacing.max_ns()), (None, None));
        for (arrival_ns, now_ns) in [(1_000_000, 50_000_000), (5_000_000, 52_000_000), (9_000_000, 54_700_000)] {
            spacing.note(arrival_ns, 2.0, now_ns);
        }
        assert_eq!(spacing.max_ns(), Some(700_000), "4 ms are 2 ms at twice the speed");
        spacing.begin();
        spacing.note(10, 2.0, 90_000_000_000);
        spacing.note(9, 2.0, 90_000_000_000);
        assert_eq!(spacing.max_ns(), Some(700_000), "what arrived before the last one is due with it");
    }
}
