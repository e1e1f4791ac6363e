//! Launch's part in system time: it begins it, and tells when the computer's clock was set away from it.

use rohrpost_config::{ClockSetPolicy, Installation, Reach, TimeSource as ConfiguredTime};
use rohrpost_mailbox::{Node, NodeError, TimeKeeper, TimeRecord, TimeSource, monotonic_ns, realtime_ns};
use rohrpost_modules::runtime::clock_was_set;
use std::sync::Arc;

/// System time of the node.
pub(super) struct NodeTime {
    keeper: TimeKeeper,
    policy: ClockSetPolicy,
    watch: SetWatch,
}

impl NodeTime {
    /// Makes the node's time page, and begins its time where launch does.
    pub(super) fn begin(node: &Arc<Node>, installation: &Installation, name: &str) -> Result<Self, NodeError> {
        let keeper = keeper(node, installation, name)?;
        Ok(Self { keeper, policy: installation.when_set, watch: SetWatch::default() })
    }

    /// Looks at the computer's clock: a line for people if it was set.
    pub(super) fn look(&mut self) -> Option<String> {
        self.look_by(monotonic_ns(), realtime_ns())
    }

    fn look_by(&mut self, now_ns: u64, wall_ns: u64) -> Option<String> {
        let record = self.keeper.record()?;
        let news = self.watch.look(record.clock_set_by(now_ns, wall_ns))?;
        let Some(by_ns) = news else { return Some("this computer's clock and system time agree again".into()) };
        let was_set = clock_was_set(by_ns);
        Some(match (self.policy, record.source) {
            (ClockSetPolicy::NewEpoch, TimeSource::Local) => {
                let epoch = self.keeper.begin_epoch(wall_ns)?;
                self.watch = SetWatch::default();
                format!("{was_set}: epoch {epoch} of time begins at it")
            }
            (ClockSetPolicy::NewEpoch, _) => {
                format!("{was_set}; if the clock of the master is as well, it begins a new epoch")
            }
            (ClockSetPolicy::Tell, source) => {
                let clock = if source == TimeSource::Local { "this clock" } else { "the clock of the master" };
                format!(
                    "{was_set}, in which all goes on; `rohrpost time --new-epoch` begins a new epoch of it at {clock}"
                )
            }
        })
    }

    /// Begins a new epoch at the computer's clock; its number. None if somebody else writes the time.
    pub(super) fn begin_epoch(&mut self) -> Option<u64> {
        let is_own = |record: &TimeRecord| record.source == TimeSource::Local;
        self.keeper.record().filter(is_own)?;
        self.keeper.begin_epoch(realtime_ns())
    }
}

/// Tells each setting of a clock once.
#[derive(Default)]
struct SetWatch {
    told_ns: Option<i64>,
}

impl SetWatch {
    /// `set_by_ns`: see [`TimeRecord::clock_set_by`]. The same if it is news, or that it is over.
    fn look(&mut self, set_by_ns: Option<i64>) -> Option<Option<i64>> {
        let is_news = match (self.told_ns, set_by_ns) {
            (None, None) => false,
            // Two settings apart, not the drift of a clock that was set once.
            (Some(told_ns), Some(by_ns)) => told_ns.abs_diff(by_ns) >= SETTINGS_APART_NS,
            _ => true,
        };
        is_news.then(|| {
            self.told_ns = set_by_ns;
            set_by_ns
        })
    }
}

/// What a clock that was set drifts away meanwhile is less, ns.
const SETTINGS_APART_NS: u64 = 3_600_000_000_000;

fn keeper(node: &Arc<Node>, installation: &Installation, name: &str) -> Result<TimeKeeper, NodeError> {
    // Likewise the client of the TCP router, where that tells the time.
    if installation.node(name).is_some_and(|node| node.reach == Reach::Tcp) {
        return TimeKeeper::await_master(node);
    }
    let (source, pace) = match installation.time {
        ConfiguredTime::Local => (TimeSource::Local, 1.0),
        // The router writes the master's time into the page as soon as it knows it; until then nobody is without a
        // time, launch itself included. Another launch must not begin another epoch: all nodes would have to.
        ConfiguredTime::Master { .. } => return TimeKeeper::await_master(node),
        ConfiguredTime::Simulation { speed } => (TimeSource::Simulation, speed),
        // The module that plays the log tells its time; until then the node has none.
        ConfiguredTime::Log => return TimeKeeper::await_source(node, TimeSource::Log),
    };
    TimeKeeper::begin(node, source, realtime_ns(), pace)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "these are tests")]

    use super::*;
    use rohrpost_mailbox::SystemClock;

    const DAY_NS: u64 = 86_400_000_000_000;
    const TODAY_NS: u64 = 20_785 * DAY_NS;

    /// A node that began in 1970, and what launch says as its computer's clock is set.
    fn began_in_1970(policy: ClockSetPolicy) -> (tempfile::TempDir, NodeTime, SystemClock) {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let keeper = TimeKeeper::begin(&node, TimeSource::Local, 60_000_000_000, 1.0).unwrap();
        let clock = SystemClock::open(&node);
        (folder, NodeTime { keeper, policy, watch: SetWatch::default() }, clock)
    }

    #[test]
    fn a_clock_that_is_set_is_told_once_each_time_and_offered_as_a_new_epoch() {
        let (_folder, mut time, clock) = began_in_1970(ClockSetPolicy::Tell);
        let began = clock.record().unwrap().monotonic_ns;
        let mut look = |after_ns: u64, wall_ns: u64| time.look_by(began + after_ns, wall_ns);
        assert_eq!(look(1, 60_000_000_001), None);
        let told = look(2, TODAY_NS).unwrap();
        assert!(told.contains("20785 days ahead") && told.contains("rohrpost time --new-epoch"), "{told}");
        assert_eq!(look(3, TODAY_NS + DAY_NS / 100), None, "it was told");
        let back = look(4, TODAY_NS - 400 * DAY_NS).unwrap();
        assert!(back.contains("20385 days ahead"), "{back}");
        assert!(look(5, 60_000_000_005).unwrap().contains("agree again"));
        assert_eq!((clock.now().epoch, time.begin_epoch()), (1, Some(2)), "nothing changes unasked");
        assert_eq!(time.look(), None);
        let back = time.look_by(monotonic_ns(), 60_000_000_000).unwrap();
        assert!(back.contains("days behind system time"), "{back}");
    }

    #[test]
    fn a_node_that_follows_its_clock_begins_an_epoch_at_it_ahead_and_back() {
        let (_folder, mut time, clock) = began_in_1970(ClockSetPolicy::NewEpoch);
        for (epoch, wall_ns) in [(2, TODAY_NS), (3, 60_000_000_000)] {
            let told = time.look_by(monotonic_ns(), wall_ns).unwrap();
            assert!(told.contains(&format!("epoch {epoch} of time begins")), "{told}");
            let now = clock.now();
            assert!(now.epoch == epoch && now.ns.abs_diff(wall_ns) < 60_000_000_000, "{now:?}");
            assert_eq!(time.look_by(monotonic_ns(), wall_ns), None);
        }
    }

    #[test]
    fn launch_begins_no_epoch_of_a_time_that_another_tells() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let keeper = TimeKeeper::await_source(&node, TimeSource::Log).unwrap();
        let mut time = NodeTime { keeper, policy: ClockSetPolicy::NewEpoch, watch: SetWatch::default() };
        assert_eq!((time.look(), time.begin_epoch()), (None, None));
    }
}
