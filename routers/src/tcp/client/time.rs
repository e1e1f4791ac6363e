//! The page of time of a node that is not on the LAN: its client of the TCP router writes it.

use crate::time::Follower;
use rohrpost_mailbox::{Node, NodeError, TimeKeeper, TimeRecord, monotonic_ns, realtime_ns};
use std::sync::Arc;

/// A record that came too late is made anew, so often.
const WRITE_TRIES: usize = 8;

/// What the node takes for system time, and where its modules read it.
pub(super) struct Time {
    follower: Follower,
    keeper: TimeKeeper,
}

impl Time {
    /// What an earlier life of this client wrote goes on.
    pub(super) fn new(node: &Arc<Node>) -> Result<Self, NodeError> {
        let keeper = TimeKeeper::resume(node)?;
        Ok(Self { follower: Follower::new(monotonic_ns(), realtime_ns(), keeper.record()), keeper })
    }

    /// What the TCP router tells after so many answers, as long as it does; writes the page if it changes.
    pub(super) fn told(&mut self, now_ns: u64, told: Option<TimeRecord>, answers: u64) {
        match told {
            Some(told) => self.follower.told(now_ns, &told, answers),
            None => self.follower.goes_on(now_ns),
        }
        for _ in 0..WRITE_TRIES {
            let record = *self.follower.record();
            if self.keeper.record() == Some(record) || self.keeper.write(&record) {
                return;
            }
            if let Some(page) = self.keeper.record() {
                self.follower.page_says(monotonic_ns(), &page);
            }
        }
    }

    /// What the page says.
    pub(super) fn record(&self) -> &TimeRecord {
        self.follower.record()
    }
}
