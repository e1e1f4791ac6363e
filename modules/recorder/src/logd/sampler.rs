//! Which values of an item are recorded, and how many of those that are missing would have been.

use rohrpost::common::DataHead;
use rohrpost_config::Sampling;
use rohrpost_mailbox::Missed;
use std::time::{Duration, Instant};

/// How the numbers of values tell what is missing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Numbering {
    /// Packages of a subscription: each that is missing leaves a gap.
    Packages,
    /// Records of a stream: the reader counts what was overwritten before it came there.
    Records,
}

/// Values that should have been recorded and did not come.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Lost {
    /// Between their publisher and this node's ring, or the recorder's mailbox.
    pub(super) way: u64,
    /// In the ring, before the recorder came to them.
    pub(super) here: u64,
}

impl Lost {
    fn all(&self) -> u64 {
        self.way.saturating_add(self.here)
    }
}

/// Chooses among the values of an item.
#[derive(Debug)]
pub(super) struct Sampler {
    sampling: Sampling,
    numbering: Numbering,
    /// Number of the next package; none if some came while nothing was recorded.
    expected: Option<u32>,
    /// Records that did not come until now.
    missed: Missed,
    /// When the next is recorded at the earliest.
    due: Option<Instant>,
}

impl Sampler {
    pub(super) fn new(sampling: Sampling, numbering: Numbering) -> Self {
        Self { sampling, numbering, expected: Some(0), missed: Missed::default(), due: None }
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
    /// `missed` tells of records why they did not come.
    pub(super) fn note(&mut self, head: &DataHead, missed: Missed, now: Instant) -> (Lost, bool) {
        let gap = self.gap(head, missed);
        match self.sampling {
            Sampling::Each => (gap, true),
            Sampling::Every(every) => {
                let (sequence, every) = (u64::from(head.sequence), u64::from(every.max(1)));
                let chosen_of = |gap: u64| sequence.div_ceil(every) - sequence.saturating_sub(gap).div_ceil(every);
                let (all, here) = (chosen_of(gap.all()), chosen_of(gap.here));
                (Lost { way: all - here, here }, sequence.is_multiple_of(every))
            }
            // Its publisher chose, and sent no other.
            Sampling::Rate(_) if self.numbering == Numbering::Packages => (gap, true),
            // A record that was overwritten has a successor, which is as good.
            Sampling::Rate(rate_hz) => (Lost::default(), self.is_due(rate_hz, now)),
        }
    }

    /// Values that are missing right before this one; none that a replica leaves out on purpose.
    fn gap(&mut self, head: &DataHead, missed: Missed) -> Lost {
        match self.numbering {
            Numbering::Packages => {
                let expected = self.expected.replace(head.sequence.wrapping_add(1));
                let gap = head.sequence.wrapping_sub(expected.unwrap_or(head.sequence));
                // A publisher that was restarted begins at 0 again; that is no gap.
                let is_gap = head.sequence != 0 && gap < u32::MAX / 2;
                Lost { way: if is_gap { gap.into() } else { 0 }, here: 0 }
            }
            Numbering::Records => {
                let new = missed.since(&std::mem::replace(&mut self.missed, missed));
                Lost { way: new.lost, here: new.passed_over }
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

    fn head(sequence: u32) -> DataHead {
        DataHead { stamp_ns: 0, sequence, missed: 0, incarnation: 0 }
    }

    fn missed(lost: u64, sampled: u64, passed_over: u64) -> Missed {
        Missed { lost, sampled, passed_over }
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
            let note = |number: &u32| sampler.note(&head(*number), Missed::default(), now);
            let noted: Vec<_> = came.iter().map(note).map(|(lost, is_chosen)| (lost.way, is_chosen)).collect();
            assert_eq!(noted, expected, "{sampling:?}");
        }
    }

    #[test]
    fn records_that_were_overwritten_are_counted_by_the_reader() {
        let mut sampler = Sampler::new(Sampling::Every(10), Numbering::Records);
        let now = Instant::now();
        for (sequence, passed_over, noted, why) in [
            (5, 0, (0, false), "the first that came, not from the beginning"),
            (10, 0, (0, true), "passed over, and not lost"),
            (35, 24, (2, false), "11 to 34 are lost: 20 and 30 should have been recorded"),
            (40, 28, (0, true), "36 to 39"),
        ] {
            let (lost, is_chosen) = sampler.note(&head(sequence), missed(0, 0, passed_over), now);
            assert_eq!(((lost.here, is_chosen), lost.way), (noted, 0), "{why}");
        }
        sampler.begin();
        let noted = sampler.note(&head(50), missed(0, 0, 28), now);
        assert_eq!(noted, (Lost::default(), true), "what came while it was off is no loss");
    }

    /// A replica has every tenth record, and two of those were lost on the way.
    #[test]
    fn what_a_replica_leaves_out_on_purpose_is_not_lost() {
        let mut sampler = Sampler::new(Sampling::Each, Numbering::Records);
        for (sequence, before, lost) in [
            (0, missed(0, 0, 0), Lost { way: 0, here: 0 }),
            (10, missed(0, 9, 0), Lost { way: 0, here: 0 }),
            (40, missed(2, 36, 0), Lost { way: 2, here: 0 }),
            (60, missed(2, 54, 1), Lost { way: 0, here: 1 }),
        ] {
            assert_eq!(sampler.note(&head(sequence), before, Instant::now()), (lost, true), "{sequence}");
        }
    }

    #[test]
    fn records_are_chosen_on_a_grid_of_time() {
        let mut sampler = Sampler::new(Sampling::Rate(10.0), Numbering::Records);
        let began = Instant::now();
        let chosen = |ms: &u64| sampler.note(&head(0), Missed::default(), began + Duration::from_millis(*ms)).1;
        let all = [0, 50, 99, 130, 199, 200, 250, 1000, 1050, 1100];
        assert_eq!(all.into_iter().filter(chosen).collect::<Vec<u64>>(), [0, 130, 200, 1000, 1100]);
    }
}
