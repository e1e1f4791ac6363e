//! The writer of a node's time, where that is a log's or a recording's.

use rohrpost_mailbox::{Node, NodeError, TimeKeeper, TimeRecord, TimeSource, monotonic_ns};
use std::sync::Arc;

/// Nanoseconds in a second.
const BILLION: f64 = 1e9;
/// The largest pace that a node's time has.
const PACE_MAX: f64 = 1000.0;

/// Tells a node the time: for the module that plays a log or a recording there. [`Context::tell_time`] makes it.
///
/// [`Context::tell_time`]: super::Context::tell_time
pub struct TimeTeller {
    keeper: TimeKeeper,
    /// Begun by this one.
    has_begun: bool,
}

impl TimeTeller {
    /// Of a node that takes its time from a log.
    pub(super) fn of(node: &Arc<Node>) -> Result<Self, NodeError> {
        Ok(Self { keeper: TimeKeeper::resume(node)?, has_begun: false })
    }

    /// Begins an epoch, at this time (ns since 1970), which passes `pace` times as fast as the world's; 0 lets it
    /// stand.
    /// Returns its number: `least_epoch`, or the next one if the node has had that.
    ///
    /// ```
    /// # use rohrpost_modules::ModuleError;
    /// # use rohrpost_modules::runtime::Context;
    /// fn begin_at_half_speed(context: &Context, first_stamp_ns: u64) -> Result<(), ModuleError> {
    ///     let mut time = context.tell_time()?;
    ///     time.begin(first_stamp_ns, 0.5, 0);
    ///     Ok(())
    /// }
    /// ```
    pub fn begin(&mut self, system_ns: u64, pace: f64, least_epoch: u64) -> u64 {
        let next = self.keeper.record().map_or(1, |last| last.epoch.saturating_add(1));
        let epoch = next.max(least_epoch);
        self.has_begun = true;
        // In another epoch time may go back, so it is written.
        self.keeper.write(&TimeRecord {
            epoch,
            source: TimeSource::Log,
            monotonic_ns: monotonic_ns(),
            system_ns,
            pace_ppb: (pace.clamp(0.0, PACE_MAX) * BILLION) as u64,
            error_ns: 0,
            drift_ns_s: 0,
        });
        epoch
    }

    /// Whether [`TimeTeller::begin`] was called.
    pub fn has_begun(&self) -> bool {
        self.has_begun
    }

    /// Goes on at another pace. False when it stays as it was: before the begin, or as this computer was too busy.
    pub fn set_pace(&mut self, pace: f64) -> bool {
        self.has_begun && self.keeper.set_pace(pace)
    }

    /// Goes on to a later time at once, in the same epoch and at the same pace. False when that has passed already, or
    /// before the begin.
    pub fn advance_to(&mut self, system_ns: u64) -> bool {
        let Some(last) = self.keeper.record().filter(|_| self.has_begun) else { return false };
        let monotonic_ns = monotonic_ns();
        let is_later = last.at(monotonic_ns).ns < system_ns;
        is_later && self.keeper.write(&TimeRecord { monotonic_ns, system_ns, ..last })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::SystemClock;

    #[test]
    fn time_begins_in_an_epoch_of_its_own_and_goes_on_to_later_times_only() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        TimeKeeper::await_source(&node, TimeSource::Log).unwrap();
        let mut time = TimeTeller::of(&node).unwrap();
        assert!(!time.has_begun() && !time.set_pace(1.0) && !time.advance_to(5), "there is no time yet");
        let clock = SystemClock::open(&node);
        let now = || (clock.now().epoch, clock.now().ns);
        assert!(!clock.record().unwrap().is_known());
        assert_eq!((time.begin(1_000, 0.0, 9), now()), (9, (9, 1_000)));
        assert!(clock.record().unwrap().is_known());
        assert!(time.advance_to(1_500) && !time.advance_to(1_400));
        assert_eq!(now(), (9, 1_500));
        assert_eq!((time.begin(10, 0.0, 3), now()), (10, (10, 10)), "the node has had epoch 3, or may have");
        assert!(time.set_pace(2.0));
        assert_eq!(clock.record().unwrap().pace_ppb, 2_000_000_000);
    }
}
