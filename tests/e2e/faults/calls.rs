//! Calls from one node to another, and the proof that none ran twice.

use super::Field;
use crate::harness::until;
use crate::probe::{COUNT, ProbingInterface};
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Name, ToolLink};
use std::collections::BTreeSet;
use std::time::Duration;

/// Calls of a counting function that must never run twice.
pub(super) struct Calls {
    tool: ToolLink,
    to: Name,
    timeout: Duration,
    /// Numbers, and the calls that carry them.
    open: Vec<(u32, u32)>,
    /// The outcome of each number.
    pub(super) answers: Vec<(u32, Result<u64, CallError>)>,
}

impl Calls {
    /// By a tool of this node. A call is repeated after each third of its timeout.
    pub(super) fn new(field: &Field, node: &str, module: &str, timeout: Duration) -> Self {
        let robot = field.robot(node);
        let (tool, to) = (robot.tool(timeout), robot.name(module));
        Self { tool, to, timeout, open: Vec::new(), answers: Vec::new() }
    }

    /// Returns at once.
    pub(super) fn begin(&mut self, number: u32) {
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        match self.tool.link.begin(self.to, COUNT, ProbingInterface::hash(), self.timeout, write) {
            Ok(call) => self.open.push((number, call)),
            Err(error) => self.answers.push((number, Err(error))),
        }
    }

    /// Takes the answers that have arrived; returns how many are still open.
    pub(super) fn look(&mut self) -> usize {
        let Self { tool, open, answers, .. } = self;
        tool.link.collect();
        open.retain(|(number, call)| match tool.link.poll_for(*call, |bytes| from_bytes(bytes)) {
            None => true,
            Some(answer) => {
                answers.push((*number, answer));
                false
            }
        });
        open.len()
    }

    /// Waits until each is answered, or has timed out.
    pub(super) fn settle(&mut self) {
        until("calls end", || self.look() == 0);
    }

    /// Stops waiting for them, and repeats none.
    pub(super) fn forget(&mut self) {
        self.open.drain(..).for_each(|(_, call)| self.tool.link.forget(call));
    }

    /// Removes its mailbox; returns the outcome of the calls.
    pub(super) fn close(self) -> Vec<(u32, Result<u64, CallError>)> {
        self.tool.close();
        self.answers
    }
}

/// The server's record and the callers' answers agree: no number was counted twice, and each answer has the position of
/// its number.
pub(super) fn assert_once(field: &Field, module: &str, answers: &[(u32, Result<u64, CallError>)]) {
    let counted = field.counted(module);
    let once: BTreeSet<u32> = counted.iter().copied().collect();
    assert_eq!(once.len(), counted.len(), "none is counted twice: {counted:?}");
    for (number, answer) in answers {
        if let Ok(place) = answer {
            assert_eq!(counted.get(*place as usize - 1), Some(number), "{place} of {counted:?}");
        }
    }
}
