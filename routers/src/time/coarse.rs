//! Coarse time of a node that cannot ask yet: from the fastest of the last eight frames. Masters state the time in
//! their Syncs; a node that has time but hears no master states it in its Request for one.

use super::clock_model::EVEN_PPB;
use super::{RATE_MAX_PPB, TimeEstimate};
use rohrpost_mailbox::{TimeRecord, TimeSource};

/// Syncs that a node hears before it sends anything.
pub const JOINING_SYNCS: u8 = 8;
const SYNCS: usize = JOINING_SYNCS as usize;

/// When a frame came, and its time.
#[derive(Clone, Copy, Debug, Default)]
struct TimeSample {
    local_ns: u64,
    system_ns: u64,
    /// The sender's largest distance from the time of the others.
    error_ns: u64,
}

/// The last frames that stated the time.
#[derive(Clone, Debug, Default)]
pub(super) struct Coarse {
    syncs: [TimeSample; SYNCS],
    epoch: u64,
    count: u8,
    next: usize,
}

impl Coarse {
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(super) fn heard(&self) -> u8 {
        self.count
    }

    /// A frame that stated `system_ns` when it was sent came at `local_ns`. `error_ns`: the sender's largest distance
    /// from the time of the others.
    pub(super) fn add(&mut self, epoch: u64, system_ns: u64, local_ns: u64, error_ns: u64) {
        if epoch != self.epoch {
            *self = Self { epoch, ..Self::default() };
        }
        self.syncs[self.next] = TimeSample { local_ns, system_ns, error_ns };
        self.next = (self.next + 1) % SYNCS;
        self.count = (self.count + 1).min(JOINING_SYNCS);
    }

    /// Distance of a time of now from the one that was heard, ns.
    pub(super) fn off_ns(&self, now_ns: u64, system_ns: u64) -> u64 {
        let heard_ns =
            self.best(now_ns).map(|best| best.system_ns.saturating_add(now_ns.saturating_sub(best.local_ns)));
        heard_ns.map_or(0, |heard_ns| heard_ns.abs_diff(system_ns))
    }

    fn best(&self, now_ns: u64) -> Option<&TimeSample> {
        self.syncs[..usize::from(self.count)].iter().max_by_key(|came| came.score(now_ns))
    }

    /// The delay is assumed to be between 0 and `delay_max_ns`. So half of that is the best guess, and half is the
    /// largest error. The sender's own error is left out: a new master makes this time the time of all, and a network
    /// with less certain slaves would have no time until they fall silent.
    pub(super) fn estimate(&self, now_ns: u64, delay_max_ns: u64) -> Option<TimeEstimate> {
        if self.count < JOINING_SYNCS {
            return None;
        }
        let (best, half_ns) = (self.best(now_ns)?, delay_max_ns / 2);
        Some(TimeEstimate::new(TimeRecord {
            epoch: self.epoch,
            source: TimeSource::Master,
            monotonic_ns: best.local_ns,
            system_ns: best.system_ns.saturating_add(half_ns),
            pace_ppb: EVEN_PPB,
            error_ns: half_ns,
            drift_ns_s: RATE_MAX_PPB.unsigned_abs(),
        }))
    }
}

impl TimeSample {
    /// A slow frame states a time that is too early; an old one may have drifted, and its sender may be off.
    fn score(&self, now_ns: u64) -> i128 {
        let age_ns = i128::from(now_ns.saturating_sub(self.local_ns));
        let sure_ns = i128::from(self.system_ns) - i128::from(self.error_ns);
        sure_ns - i128::from(self.local_ns) - age_ns * i128::from(RATE_MAX_PPB) / 1_000_000_000
    }
}
