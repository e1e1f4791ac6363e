//! What becomes of packages that leave an end of a session: counted, and the answers that are due.

use super::counts::{Cause, Counts};
use super::outgoing::Fates;
use super::{Answers, answer_to};
use rohrpost_mailbox::Head;

/// Of one connection, while something is done with what leaves by it.
pub(super) struct Ledger<'a, H> {
    counts: &'a Counts,
    host: &'a mut H,
    /// The client for which they are, where that is known.
    holder: Option<&'a str>,
    answers: Vec<(Head, Vec<u8>)>,
}

impl<'a, H> Ledger<'a, H> {
    pub(super) fn new(counts: &'a Counts, host: &'a mut H, holder: Option<&'a str>) -> Self {
        Self { counts, host, holder, answers: Vec::new() }
    }

    /// What the senders of lost commands are to be told.
    pub(super) fn into_answers(self) -> Vec<(Head, Vec<u8>)> {
        self.answers
    }
}

impl<H: Answers> Fates for Ledger<'_, H> {
    fn passed(&mut self, head: &Head) {
        self.counts.passed(head.priority);
    }

    fn replaced(&mut self, head: &Head) {
        self.counts.replaced(head.priority);
    }

    fn lost(&mut self, head: &Head, body: &[u8], cause: Cause) {
        self.counts.lost(head.priority, cause);
        self.answers.extend(answer_to(head, body, cause, self.holder, self.host));
    }
}
