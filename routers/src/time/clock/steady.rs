//! A clock whose computer sleeps, or is slewed by a time daemon: what was known ends, and is measured anew.

use super::Clock;
use crate::time::UNSYNCHRONISED_NS;
use crate::time::steadiness::{Looked, Steadiness, Unsteady};
use rohrpost_mailbox::Watched;

impl Clock {
    /// Looks whether the local clock keeps what bounds assume of it. To be called before anything else, at least once a cycle in time slots; what is
    /// wrong, if this look shows it. Then nothing is known of the time until it has been measured anew; and whoever reigned by it reigns no more.
    pub fn look_at_clocks(&mut self, looked: Looked) -> Option<Unsteady> {
        let found = self.steadiness.look(looked)?;
        self.distrust(looked.local_ns);
        Some(found)
    }

    /// Goes on watching where an earlier incarnation has ended; for a clock that is new.
    #[must_use]
    pub fn watching(mut self, now_ns: u64, watched: Option<Watched>) -> Self {
        self.steadiness = Steadiness::of(watched);
        if self.is_unsteady(now_ns) {
            self.distrust(now_ns);
        }
        self
    }

    /// What the next incarnation of this node's clock goes on from.
    pub fn watched(&self) -> Option<Watched> {
        self.steadiness.watched()
    }

    /// Why nothing is known of the time though it may be heard: what [`Self::look_at_clocks`] found.
    pub fn unsteady(&self, now_ns: u64) -> Option<Unsteady> {
        self.steadiness.why(now_ns).map(|(why, _)| why)
    }

    pub(super) fn is_unsteady(&self, now_ns: u64) -> bool {
        self.steadiness.why(now_ns).is_some()
    }

    /// The local clock did what bounds exclude. The line goes on, so that time never goes back within an epoch; where it is too far off to be bent, the
    /// master begins another.
    fn distrust(&mut self, now_ns: u64) {
        self.line.stop_slew(now_ns);
        self.line.restate(UNSYNCHRONISED_NS, 0);
        self.usual_rate = 0.0;
        self.step_back(now_ns);
        let until_ns = self.steadiness.why(now_ns).map_or(now_ns, |(_, until_ns)| until_ns);
        self.election.steps_back(until_ns);
        if let Some(slots) = &mut self.slots {
            slots.goes_by_nobody();
            self.election.overhears(&slots.overheard);
        }
    }
}
