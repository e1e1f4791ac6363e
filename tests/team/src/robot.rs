//! One robot: its clock, its processes, and what watches it.

use crate::guard::Guard;
use crate::watch::Watch;
use rohrpost_payload::{News, Payload};
use rohrpost_testbed::sim::clock::Clock;
use rohrpost_testbed::sim::team_end::TeamEnd;

/// See the module's head.
pub(crate) struct Robot {
    pub(crate) clock: Clock,
    /// `None` while the payload's process is dead.
    pub(crate) payload: Option<Payload>,
    pub(crate) guard: Guard,
    pub(crate) router: TeamEnd,
    /// When the router is looked at next, true ns.
    pub(crate) router_due_ns: u64,
    /// Stored by the payload, as its process ends at any time.
    pub(crate) incarnation: u32,
    /// The robot is switched off.
    pub(crate) is_dead: bool,
    /// No pose comes from the sensors.
    pub(crate) has_no_pose: bool,
    /// Whether a payload that keeps no promise is started again.
    pub(crate) restarts: bool,
    pub(crate) news: Vec<(u64, News)>,
    pub(crate) watch: Watch,
    /// Times at which the payload gained or lost control, true ns.
    pub(crate) control: Vec<(u64, bool)>,
}

impl Robot {
    /// What the robot's clock shows, ns.
    pub(crate) fn clock_ns(&self, now_ns: u64) -> u64 {
        self.clock.at(now_ns).monotonic_ns
    }
}
