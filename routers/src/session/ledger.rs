//! What becomes of packages that leave an end of a session: counted, and the answers that are due.

use super::counts::{Cause, SessionCounts};
use super::outgoing::Fates;
use super::server::Principals;
use super::{EndHost, answer_to};
use rohrpost_mailbox::Head;

/// Accounts for what leaves by one connection.
pub(super) struct Ledger<'a, H> {
    counts: &'a SessionCounts,
    host: &'a mut H,
    /// The client for which they are, where that is known.
    holder: Option<&'a str>,
    /// The client, where losses are counted by client.
    principals: Option<&'a mut Principals>,
    answers: Vec<(Head, Vec<u8>)>,
}

impl<'a, H> Ledger<'a, H> {
    /// `to`: the client for which the packages are, and the principals by which losses for lack of room are counted.
    pub(super) fn new(counts: &'a SessionCounts, host: &'a mut H, to: Option<(&'a str, &'a mut Principals)>) -> Self {
        let (holder, principals) = to.unzip();
        Self { counts, host, holder, principals, answers: Vec::new() }
    }

    /// What the senders of lost commands are to be told.
    pub(super) fn into_answers(self) -> Vec<(Head, Vec<u8>)> {
        self.answers
    }
}

impl<H: EndHost> Fates for Ledger<'_, H> {
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

    fn crowded(&mut self, sender: u32) {
        if let Some(uses) = self.principals.as_mut().and_then(|principals| principals.uses_mut(sender)) {
            uses.lost += 1;
        }
    }
}
