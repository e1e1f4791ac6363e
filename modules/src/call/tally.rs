//! Outcomes of the calls of one link, to show how well others are reached.

use super::Fault;
use rohrpost_mailbox::Name;
use std::collections::VecDeque;

/// Calls given up with answers that may still come; older ones stay unanswered.
const OVERDUE_MAX: usize = 64;

/// What came of the calls of one module.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tally {
    /// The called module.
    pub to: Name,
    /// Calls that have ended.
    pub calls: u64,
    /// Commands that were sent again.
    pub repeated: u64,
    /// Calls that ended without an answer, and have had none since.
    pub unanswered: u64,
    /// Calls with an answer that came too late.
    pub late: u64,
}

/// How a call ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum CallOutcome {
    /// With an answer of the called module; also one that says it was not run.
    Answered,
    /// Its command was not delivered, and a router or a mailbox said so.
    Refused,
    /// Its time was over.
    Overdue,
}

impl CallOutcome {
    /// Counter for a call that ended with this fault.
    pub(super) fn by(fault: &Fault) -> Self {
        if fault.is_of_this_try() { Self::Refused } else { Self::Answered }
    }
}

/// The calls of one link.
#[derive(Default)]
pub(super) struct Tallies {
    all: Vec<Tally>,
    /// Sequence numbers of calls that were not answered in their time, and the called modules.
    overdue: VecDeque<(u32, Name)>,
}

impl Tallies {
    /// One for each module that was called.
    pub(super) fn all(&self) -> &[Tally] {
        &self.all
    }

    /// Counts a call that has ended.
    pub(super) fn ended(&mut self, sequence: u32, to: Name, ending: CallOutcome) {
        let tally = self.of(to);
        tally.calls += 1;
        tally.unanswered += u64::from(ending != CallOutcome::Answered);
        if ending == CallOutcome::Overdue {
            if self.overdue.len() == OVERDUE_MAX {
                self.overdue.pop_front();
            }
            self.overdue.push_back((sequence, to));
        }
    }

    /// Counts a command that was sent again.
    pub(super) fn repeated(&mut self, to: Name) {
        self.of(to).repeated += 1;
    }

    /// An answer came to none of the calls under way: perhaps to one that was given up. `is_of` tells whether the
    /// answering module was called when this one was.
    pub(super) fn came_late(&mut self, sequence: u32, is_of: impl Fn(Name) -> bool) {
        let its = |(number, to): &(u32, Name)| *number == sequence && is_of(*to);
        let Some((_, to)) = self.overdue.iter().position(its).and_then(|at| self.overdue.remove(at)) else { return };
        let tally = self.of(to);
        tally.unanswered -= 1;
        tally.late += 1;
    }

    fn of(&mut self, to: Name) -> &mut Tally {
        let to = to.module();
        let at = self.all.iter().position(|tally| tally.to == to).unwrap_or_else(|| {
            self.all.push(Tally { to, calls: 0, repeated: 0, unanswered: 0, late: 0 });
            self.all.len() - 1
        });
        &mut self.all[at]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SERVER: Name = Name::new(1, 200, 1, 0);
    const OTHER: Name = Name::new(1, 201, 1, 0);

    fn counts(tallies: &Tallies) -> Vec<(Name, u64, u64, u64)> {
        tallies.all().iter().map(|tally| (tally.to, tally.calls, tally.unanswered, tally.late)).collect()
    }

    #[test]
    fn an_answer_that_comes_late_is_no_longer_missing_and_counts_once() {
        let mut tallies = Tallies::default();
        tallies.ended(1, SERVER, CallOutcome::Answered);
        tallies.ended(2, SERVER, CallOutcome::Overdue);
        tallies.ended(3, SERVER.with_local(9), CallOutcome::Refused);
        tallies.ended(4, OTHER, CallOutcome::Overdue);
        assert_eq!(counts(&tallies), [(SERVER, 3, 2, 0), (OTHER, 1, 1, 0)]);
        // Of no call; of one that was answered, or refused; of another module's.
        for (sequence, from) in [(9, SERVER), (1, SERVER), (3, SERVER), (2, OTHER)] {
            tallies.came_late(sequence, |to| to.module() == from);
            assert_eq!(counts(&tallies), [(SERVER, 3, 2, 0), (OTHER, 1, 1, 0)], "{sequence}");
        }
        for _ in 0..2 {
            tallies.came_late(2, |to| to == SERVER);
            assert_eq!(counts(&tallies), [(SERVER, 3, 1, 1), (OTHER, 1, 1, 0)]);
        }
    }

    #[test]
    fn of_calls_given_up_the_last_are_remembered_and_the_others_stay_unanswered() {
        let mut tallies = Tallies::default();
        let given_up = 0..OVERDUE_MAX as u32 + 10;
        given_up.clone().for_each(|sequence| tallies.ended(sequence, SERVER, CallOutcome::Overdue));
        given_up.for_each(|sequence| tallies.came_late(sequence, |_| true));
        assert_eq!(counts(&tallies), [(SERVER, OVERDUE_MAX as u64 + 10, 10, OVERDUE_MAX as u64)]);
    }
}
