//! Answers in the name of modules that are not reached, as the routers of the LAN write them.

use crate::session::Cause;
use crate::shell::{Faults, Undelivered};
use std::sync::Arc;

/// Writes them.
pub(crate) struct FaultWriter {
    faults: Arc<dyn Faults>,
    /// What is said to be silent if nobody knows which client it was for.
    beyond: String,
    /// Bytes that the mailbox takes which refused the last package.
    pub(crate) takes_bytes: Option<usize>,
    /// Line of the rule that refused the last package.
    pub(crate) rule: Option<usize>,
}

impl FaultWriter {
    pub(crate) fn new(faults: Arc<dyn Faults>, beyond: String) -> Self {
        Self { faults, beyond, takes_bytes: None, rule: None }
    }

    /// See [`EndHost::answer`](crate::session::EndHost::answer).
    pub(crate) fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool {
        let Some(cause) = why.told() else { return false };
        let node = Some(holder.unwrap_or(&self.beyond));
        self.faults.write(
            call,
            &Undelivered { cause, node, mismatch: None, takes_bytes: self.takes_bytes.take(), rule: self.rule.take() },
            answer,
        )
    }
}
