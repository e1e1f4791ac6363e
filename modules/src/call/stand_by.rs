//! What a module waits for that stands by for another node: until this node runs the module.

use rohrpost_mailbox::{Receiver, wait_any};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a module waits for that stands by. Somebody sets one of these, and rings the participant.
pub(crate) struct StandBy {
    /// This node holds the module's lease.
    pub(crate) holds: Arc<AtomicBool>,
    /// The process is to end.
    pub(crate) stop: Arc<AtomicBool>,
}

impl StandBy {
    /// Sleeps on the participant's mailbox until this node runs the module. False: the process is to end.
    pub(super) fn wait(&self, replies: &mut Receiver) -> bool {
        let (holds, stop) = (|| self.holds.load(Ordering::Acquire), || self.stop.load(Ordering::Acquire));
        while !holds() && !stop() {
            wait_any(&mut [&mut *replies], None, || holds() || stop());
        }
        !stop()
    }
}
