//! Conversion between system time and local time for a node that sends in time slots.

use super::clock_model::BILLION;
use rohrpost_mailbox::TimeRecord;

/// The line by which a node finds its slots. Its bound is the distance from the time of the present master. That
/// master's error against an earlier term is not in it, since all nodes of a term share it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TimeEstimate {
    record: TimeRecord,
}

impl TimeEstimate {
    pub(crate) fn new(record: TimeRecord) -> Self {
        Self { record }
    }

    /// Times of different epochs cannot be compared.
    pub fn epoch(&self) -> u64 {
        self.record.epoch
    }

    /// System time at a moment of the local clock, ns.
    pub fn system_ns(&self, local_ns: u64) -> u64 {
        self.record.at(local_ns).ns
    }

    /// How far off it is at most then, ns.
    pub fn bound_ns(&self, local_ns: u64) -> u64 {
        u64::try_from(self.record.at(local_ns).error.as_nanos()).unwrap_or(u64::MAX)
    }

    /// The first moment of the local clock at which system time is `system_ns` or later. None if there is none.
    pub fn first_ns(&self, system_ns: u64) -> Option<u64> {
        let pace = i128::from(self.record.pace_ppb);
        if pace == 0 {
            return None;
        }
        let ahead_ns = i128::from(system_ns) - i128::from(self.record.system_ns);
        // As `TimeRecord::at` rounds: towards the record's beginning.
        let since_ns = if ahead_ns > 0 {
            (ahead_ns * BILLION + pace - 1).div_euclid(pace)
        } else {
            ((ahead_ns - 1) * BILLION).div_euclid(pace) + 1
        };
        let local_ns = i128::from(self.record.monotonic_ns) + since_ns;
        u64::try_from(local_ns.max(0)).ok()
    }

    /// The last moment of the local clock at which system time is `system_ns` or earlier. None if there is none.
    pub fn last_ns(&self, system_ns: u64) -> Option<u64> {
        self.first_ns(system_ns.checked_add(1)?)?.checked_sub(1)
    }
}
