//! How exactly a replay keeps the distances between values, and how much of the error is not its own, since others had
//! its processor.

use rohrpost_mailbox::Latency;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::time::Duration;

/// What the kernel counts of a thread: time on a processor, time that it was ready to run and had none, ns.
const COUNTS: &str = "/proc/thread-self/schedstat";
/// More than three numbers have.
const COUNTS_BYTES: usize = 80;

/// A value that was played.
#[derive(Clone, Copy)]
pub(super) struct PlayedAt {
    /// When it arrived as it was recorded.
    pub(super) arrival_ns: u64,
    /// Now, by the computer's clock.
    pub(super) now_ns: u64,
    /// It is so late.
    pub(super) late_ns: u64,
}

/// Distances between values that were played one after the other, against the recorded ones at the same rate.
#[derive(Default)]
pub(super) struct Spacing {
    last: Option<LastPlayed>,
    all: SpacingErrors,
    own: SpacingErrors,
}

/// Errors of distances.
#[derive(Default)]
pub(super) struct SpacingErrors(Latency);

struct LastPlayed {
    at: PlayedAt,
    /// Until now the thread has waited so long for a processor.
    waited_ns: u64,
    /// That much of its being late came of waiting.
    others_ns: u64,
}

impl LastPlayed {
    /// When it would have been played without that.
    fn own_ns(&self) -> u64 {
        self.at.now_ns.saturating_sub(self.others_ns)
    }
}

impl Spacing {
    /// The next value has no distance to the last one: time stood still between them, or stepped, or changed its pace.
    pub(super) fn begin(&mut self) {
        self.last = None;
    }

    /// A value was played; by then the thread has waited so long for a processor, since it began.
    pub(super) fn note(&mut self, at: PlayedAt, rate: f64, waited_ns: u64) {
        let last = self.last.take();
        let before = last.as_ref().map_or((waited_ns, 0), |last| (last.waited_ns, last.others_ns));
        // What comes of waiting is at most all of it, and less once the values behind have caught up.
        let others_ns = (before.1 + waited_ns.saturating_sub(before.0)).min(at.late_ns);
        if let Some(last) = last {
            let recorded_ns = at.arrival_ns.saturating_sub(last.at.arrival_ns) as f64 / rate;
            self.all.note(at.now_ns, last.at.now_ns, recorded_ns);
            self.own.note(at.now_ns.saturating_sub(others_ns), last.own_ns(), recorded_ns);
        }
        self.last = Some(LastPlayed { at, waited_ns, others_ns });
    }

    /// Errors of all distances.
    pub(super) fn all(&self) -> &SpacingErrors {
        &self.all
    }

    /// The same without what came of waiting for a processor.
    pub(super) fn own(&self) -> &SpacingErrors {
        &self.own
    }
}

impl SpacingErrors {
    fn note(&mut self, now_ns: u64, last_ns: u64, recorded_ns: f64) {
        let error_ns = (now_ns.saturating_sub(last_ns) as f64 - recorded_ns).abs();
        self.0.count_one(Duration::from_nanos(error_ns as u64));
    }

    /// The error that this share of the distances did not exceed, in nanoseconds.
    pub(super) fn quantile_ns(&self, share: f64) -> Option<u64> {
        self.0.quantile(share).map(|error| error.as_nanos() as u64)
    }

    /// The largest error, in nanoseconds.
    pub(super) fn max_ns(&self) -> Option<u64> {
        (self.0.count() > 0).then_some(self.0.max.as_nanos() as u64)
    }
}

/// How long a thread has waited for a processor.
pub(super) struct ProcessorWaits(Option<File>);

impl ProcessorWaits {
    /// Of this thread.
    pub(super) fn of_this_thread() -> Self {
        Self(File::open(COUNTS).ok())
    }

    /// Until now; nothing where the kernel does not count it.
    pub(super) fn waited_ns(&self) -> u64 {
        let mut text = [0; COUNTS_BYTES];
        let read = self.0.as_ref().and_then(|file| file.read_at(&mut text, 0).ok()).unwrap_or_default();
        let count = std::str::from_utf8(&text[..read]).ok().and_then(|text| text.split(' ').nth(1)?.parse().ok());
        count.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played(arrival_ns: u64, now_ns: u64, late_ns: u64) -> PlayedAt {
        PlayedAt { arrival_ns, now_ns, late_ns }
    }

    #[test]
    fn distances_are_compared_at_the_rate_of_the_replay() {
        let mut spacing = Spacing::default();
        assert_eq!((spacing.all().quantile_ns(0.99), spacing.own().max_ns()), (None, None));
        for (arrival_ns, now_ns) in [(1_000_000, 50_000_000), (5_000_000, 52_000_000), (9_000_000, 54_700_000)] {
            spacing.note(played(arrival_ns, now_ns, 0), 2.0, 0);
        }
        assert_eq!(spacing.all().max_ns(), Some(700_000), "4 ms are 2 ms at twice the speed");
        spacing.begin();
        spacing.note(played(10, 90_000_000_000, 0), 2.0, 0);
        spacing.note(played(9, 90_000_000_000, 0), 2.0, 0);
        assert_eq!(spacing.all().max_ns(), Some(700_000), "what arrived before the last one is due with it");
    }

    #[test]
    fn what_came_of_waiting_for_a_processor_is_told_apart() {
        const MS: u64 = 1_000_000;
        // Each is due 10 ms behind the one before, but the third and fourth, which are due 1 ms behind.
        for (waited_ms, own_ms, why) in [
            ([0, 0, 0, 0, 0], 2, "it was late by itself"),
            ([0, 2, 2, 2, 2], 0, "it had no processor for 2 ms"),
            ([0, 1, 1, 1, 1], 1, "it had none for one of them"),
            ([0, 9, 9, 9, 9], 0, "no more than it was late"),
        ] {
            let mut spacing = Spacing::default();
            let course = [(0, 0, 0), (10, 12, 2), (11, 12, 1), (12, 12, 0), (22, 22, 0)];
            for ((due_ms, at_ms, late_ms), waited_ms) in course.into_iter().zip(waited_ms) {
                spacing.note(played(due_ms * MS, (100 + at_ms) * MS, late_ms * MS), 1.0, waited_ms * MS);
            }
            assert_eq!(spacing.all().max_ns(), Some(2 * MS));
            assert_eq!(spacing.own().max_ns(), Some(own_ms * MS), "{why}");
        }
    }

    #[test]
    fn the_kernel_counts_waits_of_this_thread() {
        let text = std::fs::read_to_string(COUNTS).unwrap();
        let before: u64 = text.split(' ').nth(1).unwrap().parse().unwrap();
        assert!(ProcessorWaits::of_this_thread().waited_ns() >= before);
        assert_eq!(ProcessorWaits(None).waited_ns(), 0);
    }
}
