//! The time by which the way of a record is measured.

use rohrpost_mailbox::{Node, SystemClock, SystemTime};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// The round trip by which a node's clock was measured. Written by the thread that measures.
#[derive(Clone, Debug, Default)]
pub struct MeasuredRoundTrip(Arc<AtomicU64>);

impl MeasuredRoundTrip {
    /// `None`: nothing was measured.
    pub fn set(&self, round_trip_ns: Option<u64>) {
        self.0.store(round_trip_ns.unwrap_or(0), Ordering::Relaxed);
    }

    fn half(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed) / 2)
    }
}

/// System time by which the way of a record is measured, from one node to another. Half of the round trip by which the
/// clock was measured is taken for one way, so it is no error here. The bound of system time assumes nothing about
/// that, and is at least as large: measured by it no steady delay would ever be told.
pub struct OneWayClock {
    clock: SystemClock,
    round_trip: MeasuredRoundTrip,
}

impl OneWayClock {
    /// The clock of this node.
    pub fn open(node: &Node, round_trip: MeasuredRoundTrip) -> Self {
        Self { clock: SystemClock::open(node), round_trip }
    }

    /// System time now.
    pub fn now(&self) -> SystemTime {
        self.without_way(self.clock.now())
    }

    /// System time at a moment of the monotonic clock.
    pub fn at(&self, monotonic_ns: u64) -> SystemTime {
        self.without_way(self.clock.at(monotonic_ns))
    }

    fn without_way(&self, time: SystemTime) -> SystemTime {
        SystemTime { error: time.error.saturating_sub(self.round_trip.half()), ..time }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "these are tests")]

    use super::*;
    use rohrpost_mailbox::{TimeKeeper, TimeRecord, TimeSource, monotonic_ns};

    #[test]
    fn half_of_the_round_trip_is_no_error_and_what_nobody_knows_stays_unknown() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let mut keeper = TimeKeeper::resume(&node).unwrap();
        let mut write = |error_ns| {
            let (monotonic_ns, source) = (monotonic_ns(), TimeSource::Master);
            let (system_ns, pace_ppb, drift_ns_s) = (monotonic_ns + 9_000_000_000, 1_000_000_000, 0);
            let record = TimeRecord { epoch: 1, source, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s };
            assert!(keeper.write(&record));
        };
        write(20_003_000);
        let round_trip = MeasuredRoundTrip::default();
        let clock = OneWayClock::open(&node, round_trip.clone());
        assert_eq!(clock.now().error, Duration::from_micros(20_003), "nothing was measured");
        round_trip.set(Some(40_000_000));
        assert_eq!(clock.now().error, Duration::from_micros(3));
        round_trip.set(Some(60_000_000));
        assert_eq!(clock.at(monotonic_ns()).error, Duration::ZERO);
        write(rohrpost_mailbox::ERROR_UNKNOWN_NS);
        assert!(clock.now().error > Duration::from_secs(86_400));
    }
}
