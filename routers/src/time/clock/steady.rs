//! A clock on a computer that sleeps, or with a time daemon that slews it: the known time ends, and is measured anew.

use super::Clock;
use crate::time::UNSYNCHRONISED_NS;
use crate::time::steadiness::{Looked, Steadiness, Unsteady};
use rohrpost_mailbox::Watched;

impl Clock {
    /// Checks whether the local clock keeps its limits. Call it before anything else, at least once a cycle in time
    /// slots. Returns the fault, if this look shows one. Then the time is unknown until it has been measured anew, and
    /// a master steps down.
    pub fn look_at_clocks(&mut self, looked: Looked) -> Option<Unsteady> {
        let found = self.steadiness.look(looked)?;
        self.distrust(looked.local_ns);
        Some(found)
    }

    /// Continues to watch where an earlier incarnation ended; for a new clock.
    #[must_use]
    pub fn watching(mut self, now_ns: u64, watched: Option<Watched>) -> Self {
        self.steadiness = Steadiness::of(watched);
        if self.is_unsteady(now_ns) {
            self.distrust(now_ns);
        }
        self
    }

    /// State for the next incarnation of this node's clock.
    pub fn watched(&self) -> Option<Watched> {
        self.steadiness.watched()
    }

    /// Why the time is unknown though it may be heard: the finding of [`Self::look_at_clocks`].
    pub fn unsteady(&self, now_ns: u64) -> Option<Unsteady> {
        self.steadiness.why(now_ns).map(|(why, _)| why)
    }

    pub(super) fn is_unsteady(&self, now_ns: u64) -> bool {
        self.steadiness.why(now_ns).is_some()
    }

    /// The local clock broke its limits. The line continues, so that time never goes back within an epoch. If it is too
    /// far off to be slewed, the master begins another epoch.
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
