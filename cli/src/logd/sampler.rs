//! Which values of an item are recorded, and how many of those that are missing would have been.

use rohrpost::common::DataHead;
use rohrpost_config::Sampling;
use std::time::{Duration, Instant};

/// How the numbers of values tell what is missing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Numbering {
    /// Packages of a subscription: each that is missing leaves a gap.
    Packages,
    /// Records of a stream: the reader counts what was overwritten before it came there.
    Records,
}

/// Chooses among the values of an item.
#[derive(Debug)]
pub(super) struct Sampler {
    sampling: Sampling,
    numbering: Numbering,
    /// Number of the next package; none if some came while nothing was recorded.
    expected: Option<u32>,
    /// Records that were lost until now.
    missed: u32,
    /// When the next is recorded at the earliest.
    due: Option<Instant>,
}

impl Sampler {
    pub(super) fn new(sampling: Sampling, numbering: Numbering) -> Self {
        Self { sampling, numbering, expected: Some(0), missed: 0, due: None }
    }

    /// How values come.
    pub(super) fn numbering(&self) -> Numbering {
        self.numbering
    }

    /// What came while it was switched off is no loss.
    pub(super) fn begin(&mut self) {
        (self.expected, self.due) = (None, None);
    }

    /// Notes a value that came: how many are lost that should have been recorded before it, and whether it is to be.
    pub(super) fn note(&mut self, head: &DataHead, now: Instant) -> (u64, bool) {
        let gap = self.gap(head);
        let sequence = u64::from(head.sequence);
        match self.sampling {
            Sampling::Each => (gap, true),
            Sampling::Every(every) => {
                let every = u64::from(every.max(1));
                let chosen_before = |number: u64| number.div_ceil(every);
                let lost = chosen_before(sequence) - chosen_before(sequence.saturating_sub(gap));
                (lost, sequence.is_multiple_of(every))
            }
            // Its publisher chose, and sent no other.
            Sampling::Rate(_) if self.numbering == Numbering::Packages => (gap, true),
            // A record that was overwritten has a successor, which is as good.
            Sampling::Rate(rate_hz) => (0, self.is_due(rate_hz, now)),
        }
    }

    /// Values that are missing right before this one.
    fn gap(&mut self, head: &DataHead) -> u64 {
        match self.numbering {
            Numbering::Packages => {
                let expected = self.expected.replace(head.sequence.wrapping_add(1));
                let gap = head.sequence.wrapping_sub(expected.unwrap_or(head.sequence));
                // A publisher that was restarted begins at 0 again; that is no gap.
                if head.sequence == 0 || gap >= u32::MAX / 2 { 0 } else { gap.into() }
            }
            Numbering::Records => {
                let missed = std::mem::replace(&mut self.missed, head.missed);
                head.missed.saturating_sub(missed).into()
            }
        }
    }

    fn is_due(&mut self, rate_hz: f64, now: Instant) -> bool {
        if self.due.is_some_and(|due| now < due) {
            return false;
        }
        let period = Duration::try_from_secs_f64(1.0 / rate_hz).unwrap_or(Duration::MAX);
        // On a grid, so that a record a little late does not make the next ones late; a gap begins the grid anew.
        let on_grid = self.due.and_then(|due| due.checked_add(period)).filter(|next| *next > now);
        self.due = on_grid.or_else(|| now.checked_add(period));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(sequence: u32, missed: u32) -> DataHead {
        DataHead { stamp_ns: 0, sequence, missed, incarnation: 0 }
    }

    #[test]
    fn packages_that_are_missing_leave_gaps() {
        for (sampling, came, expected) in [
            (
                Sampling::Each,
                &[1, 2, 5, 6, 0, 1][..],
                &[(1, true), (0, true), (2, true), (0, true), (0, true), (0, true)][..],
            ),
            (
                Sampling::Every(3),
                &[1, 3, 4, 7, 9, 10, 17],
                &[(1, false), (0, true), (0, false), (1, false), (0, true), (0, false), (2, false)],
            ),
            (Sampling::Rate(2.0), &[0, 2], &[(0, true), (1, true)]),
        ] {
            let mut sampler = Sampler::new(sampling, Numbering::Packages);
            let now = Instant::now();
            let noted: Vec<_> = came.iter().map(|number| sampler.note(&head(*number, 0), now)).collect();
            assert_eq!(noted, expected, "{sampling:?}");
        }
    }

    #[test]
    fn records_that_were_overwritten_are_counted_by_the_reader() {
        let mut sampler = Sampler::new(Sampling::Every(10), Numbering::Records);
        let now = Instant::now();
        for (sequence, missed, noted, why) in [
            (5, 0, (0, false), "the first that came, not from the beginning"),
            (10, 0, (0, true), "passed over, and not lost"),
            (35, 24, (2, false), "11 to 34 are lost: 20 and 30 should have been recorded"),
            (40, 28, (0, true), "36 to 39"),
        ] {
            assert_eq!(sampler.note(&head(sequence, missed), now), noted, "{why}");
        }
        sampler.begin();
        assert_eq!(sampler.note(&head(50, 28), now), (0, true), "what came while it was off is no loss");
    }

    #[test]
    fn records_are_chosen_on_a_grid_of_time() {
        let mut sampler = Sampler::new(Sampling::Rate(10.0), Numbering::Records);
        let began = Instant::now();
        let chosen = |ms: &u64| sampler.note(&head(0, 0), began + Duration::from_millis(*ms)).1;
        let all = [0, 50, 99, 130, 199, 200, 250, 1000, 1050, 1100];
        assert_eq!(all.into_iter().filter(chosen).collect::<Vec<u64>>(), [0, 130, 200, 1000, 1100]);
    }
}
