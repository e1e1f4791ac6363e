//! The page of time of a node that is not on the LAN: its client of the TCP router writes it.

use crate::shell::clock::looked;
use crate::time::{Follower, Looked, Steadiness};
use rohrpost_mailbox::{Node, NodeError, TimeKeeper, TimeRecord, monotonic_ns, realtime_ns};
use std::sync::Arc;

/// A record that came too late is made anew, so often.
const WRITE_TRIES: usize = 8;

/// System time of the node, and the page on which its modules read it.
pub(super) struct Time {
    follower: Follower,
    keeper: TimeKeeper,
    steadiness: Steadiness,
}

impl Time {
    /// What an earlier incarnation of this client wrote goes on.
    pub(super) fn new(node: &Arc<Node>) -> Result<Self, NodeError> {
        let keeper = TimeKeeper::resume(node)?;
        let follower = Follower::new(monotonic_ns(), realtime_ns(), keeper.record());
        let steadiness = Steadiness::of(keeper.watched());
        let mut time = Self { follower, keeper, steadiness };
        time.is_steady();
        Ok(time)
    }

    /// Whether this computer's clock is one to measure by. If it slept, or its clock is slewed, nothing is known any
    /// more.
    pub(super) fn is_steady(&mut self) -> bool {
        self.is_steady_by(looked())
    }

    fn is_steady_by(&mut self, looked: Looked) -> bool {
        let was_steady = self.steadiness.why(looked.local_ns).is_none();
        if let Some(why) = self.steadiness.look(looked) {
            self.follower.distrusts(looked.local_ns);
            if was_steady {
                tracing::warn!("nothing is known of the time until it has been measured anew: {why}");
            }
        }
        if let Some(watched) = self.steadiness.watched() {
            self.keeper.note_watched(&watched);
        }
        self.steadiness.why(looked.local_ns).is_none()
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

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::{ERROR_UNKNOWN_NS, SystemClock, TimeSource};

    const SECOND_NS: u64 = 1_000_000_000;

    #[test]
    fn a_node_that_slept_says_that_it_does_not_know_the_time_and_measures_it_anew() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let mut time = Time::new(&node).unwrap();
        let told = |now_ns: u64, ahead_ns: u64| TimeRecord {
            epoch: 3,
            source: TimeSource::Master,
            monotonic_ns: now_ns,
            system_ns: now_ns + ahead_ns,
            pace_ppb: SECOND_NS,
            error_ns: 10_000_000,
            drift_ns_s: 0,
        };
        let mut answers = 0;
        let mut tells = |time: &mut Time, now_ns: u64, ahead_ns: u64| {
            for _ in 0..4 {
                answers += 1;
                time.told(now_ns, Some(told(now_ns, ahead_ns)), answers);
            }
        };
        let before = looked();
        let now_ns = before.local_ns;
        assert!(time.is_steady_by(before));
        tells(&mut time, now_ns, SECOND_NS);
        let page = SystemClock::open(&node);
        assert_eq!(page.record().unwrap().error_ns, 10_000_000);
        // An hour by clocks that count it, with an error of a second.
        let slept_ns = 3_600 * SECOND_NS;
        let after = Looked { local_ns: now_ns + slept_ns, slept_ns: before.slept_ns + slept_ns, ..before };
        assert!(!time.is_steady_by(after));
        time.told(after.local_ns, None, 4);
        let record = page.record().unwrap();
        assert_eq!(
            (record.epoch, record.error_ns),
            (0, ERROR_UNKNOWN_NS),
            "nobody is told a time that may be a second off"
        );
        let later =
            Looked { local_ns: after.local_ns + SECOND_NS, unslewed_ns: before.unslewed_ns + SECOND_NS, ..after };
        assert!(time.is_steady_by(later));
        tells(&mut time, later.local_ns, 2 * SECOND_NS);
        let record = page.record().unwrap();
        assert_eq!((record.epoch, record.at(later.local_ns).ns), (3, later.local_ns + 2 * SECOND_NS));
    }
}
