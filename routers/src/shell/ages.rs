//! Age of data when they come out of the network: from their stamp, by system time, including the errors of both
//! clocks.
//!
//! One thread counts, any reads. A package without a stamp (a command, a reply) is not counted.

use crate::latencies::Latencies;
use rohrpost_mailbox::{Class, Head, Latency, Node, Options, SystemClock};
use std::sync::Arc;

/// Ages of stamped packages that were delivered, by class.
pub struct Ages {
    clock: SystemClock,
    classes: Box<[Latencies]>,
}

impl Ages {
    pub(super) fn new(node: &Arc<Node>) -> Self {
        Self { clock: SystemClock::open(node), classes: (0..=u8::MAX).map(|_| Latencies::default()).collect() }
    }

    /// A package was delivered.
    pub(super) fn note(&self, head: &Head, body: &[u8]) {
        let Some(stamp) = body.first_chunk().filter(|_| head.options.has(Options::STAMPED)) else { return };
        // One from the future, by clocks that are not synchronised yet, counts as new.
        let age_ns = self.clock.now().ns.saturating_sub(u64::from_le_bytes(*stamp));
        self.classes[usize::from(head.priority.0)].note(age_ns);
    }

    /// Those of a class so far.
    pub fn of(&self, class: Class) -> Latency {
        self.classes[usize::from(class.0)].get()
    }
}
