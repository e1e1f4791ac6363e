//! The writer of a node's system time.

use super::{BILLION, ERROR_UNKNOWN_NS, FILE, TimePage, TimeRecord, TimeSource, Watched, Written, map};
use crate::clock::{monotonic_ns, realtime_ns, slept_ns};
use crate::memory::mapping::Mapping;
use crate::node::directory::Node;
use crate::node::error::NodeError;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A slower pace begins so far ahead: longer than writing a record takes. A writer that was held up tries again, so
/// often.
const SLOWER_LEAD_NS: u64 = 1_000_000;
const WRITE_TRIES: usize = 8;
/// Stands for a rate that is not known.
const NO_RATE: u64 = i64::MIN.cast_unsigned();
/// Where time stands as long as its source has not begun, ns. Not 0, which stamps nothing.
const NOT_BEGUN_NS: u64 = 1;

/// Writes a node's system time. There is one: the launch of the node, the router that hears the master, or the module
/// that plays a log.
pub struct TimeKeeper {
    mapping: Mapping,
    /// What this incarnation has noted last.
    watched: Option<Watched>,
}

impl TimeKeeper {
    /// Opens the page, making it if need be, and begins a new epoch at this system time.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn begin(node: &Arc<Node>, source: TimeSource, system_ns: u64, pace: f64) -> Result<Self, NodeError> {
        let failed = |error| NodeError::of(&node.path().join(FILE), error);
        let keeper = Self { mapping: map(node.directory(), true).map_err(failed)?, watched: None };
        let page: &TimePage = keeper.mapping.at(0);
        page.writer_pid.store(std::process::id(), Ordering::Relaxed);
        let epoch = page.read().map_or(1, |last| last.record.epoch.saturating_add(1));
        page.fill(&Written::now(TimeRecord {
            epoch,
            source,
            monotonic_ns: monotonic_ns(),
            system_ns,
            pace_ppb: (pace.clamp(0.0, 1000.0) * 1e9) as u64,
            error_ns: 0,
            drift_ns_s: 0,
        }));
        page.index.publish();
        Ok(keeper)
    }

    /// Begins the next epoch at this system time, ahead or back, from the same source and at the same pace. Returns its
    /// number; none if nobody wrote the page yet.
    pub fn begin_epoch(&mut self, system_ns: u64) -> Option<u64> {
        let last = self.record()?;
        let epoch = last.epoch.saturating_add(1);
        // In another epoch time may go back, so it is written.
        self.write(&TimeRecord { epoch, monotonic_ns: monotonic_ns(), system_ns, ..last });
        Some(epoch)
    }

    /// Opens the page of a node that is to have the master's time. What it has of it stays. Else there is the wall
    /// clock, with a bound that says that nobody knows, until the node's router has heard a master.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn await_master(node: &Arc<Node>) -> Result<Self, NodeError> {
        let mut keeper = Self::resume(node)?;
        let last = keeper.record();
        if last.is_none_or(|last| last.source != TimeSource::Master) {
            keeper.write(&TimeRecord {
                epoch: last.map_or(0, |last| last.epoch.saturating_add(1)),
                source: TimeSource::Master,
                monotonic_ns: monotonic_ns(),
                system_ns: realtime_ns(),
                pace_ppb: BILLION as u64,
                error_ns: ERROR_UNKNOWN_NS,
                drift_ns_s: 0,
            });
        }
        Ok(keeper)
    }

    /// Opens the page of a node for a time that another process is to begin: the player of a log. Until it does there
    /// is no time: it stands still next to 0 in an epoch of its own, with a bound that says that nobody knows it.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn await_source(node: &Arc<Node>, source: TimeSource) -> Result<Self, NodeError> {
        let mut keeper = Self::resume(node)?;
        keeper.write(&TimeRecord {
            epoch: keeper.record().map_or(0, |last| last.epoch.saturating_add(1)),
            source,
            monotonic_ns: monotonic_ns(),
            system_ns: NOT_BEGUN_NS,
            pace_ppb: 0,
            error_ns: ERROR_UNKNOWN_NS,
            drift_ns_s: 0,
        });
        Ok(keeper)
    }

    /// Opens the page, making it if need be, and leaves what it says: a restarted writer goes on from there.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn resume(node: &Arc<Node>) -> Result<Self, NodeError> {
        let failed = |error| NodeError::of(&node.path().join(FILE), error);
        let keeper = Self { mapping: map(node.directory(), true).map_err(failed)?, watched: None };
        let page: &TimePage = keeper.mapping.at(0);
        page.writer_pid.store(std::process::id(), Ordering::Relaxed);
        Ok(keeper)
    }

    /// What the page says; none if nobody wrote it yet. If the computer has slept since, nobody knows how far off that
    /// is.
    pub fn record(&self) -> Option<TimeRecord> {
        let page: &TimePage = self.mapping.at(0);
        Some(page.read()?.read(slept_ns()))
    }

    /// What was seen last of this computer's clocks, if anything was.
    pub fn watched(&self) -> Option<Watched> {
        let page: &TimePage = self.mapping.at(0);
        let [local_ns, unslewed_ns, apart_ns, slept_ns, rate, unsteady_until_ns] =
            page.watched.each_ref().map(|field| field.load(Ordering::Relaxed));
        let rate_ppb = (rate != NO_RATE).then_some(rate.cast_signed());
        (local_ns > 0).then_some(Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns })
    }

    /// Notes what was seen, for the next incarnation of the writer. Records that are written from then on are of this
    /// moment: if the computer sleeps before one is written, its readers see that.
    pub fn note_watched(&mut self, watched: &Watched) {
        if self.watched.replace(*watched) == Some(*watched) {
            return;
        }
        let Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns } = *watched;
        let rate = rate_ppb.map_or(NO_RATE, i64::cast_unsigned);
        let page: &TimePage = self.mapping.at(0);
        let all = [local_ns, unslewed_ns, apart_ns, slept_ns, rate, unsteady_until_ns];
        for (field, value) in page.watched.iter().zip(all) {
            field.store(value, Ordering::Relaxed);
        }
    }

    /// Makes this the page's record. False, and the page stays as it was, if time would go back within its epoch just
    /// now: because the record is of a slower pace, and this thread was held up until it was too late for it.
    pub fn write(&mut self, record: &TimeRecord) -> bool {
        let page: &TimePage = self.mapping.at(0);
        let last = page.read().map(|last| last.record).filter(|last| last.epoch == record.epoch);
        page.fill(&Written { record: *record, slept_ns: self.watched.map_or_else(slept_ns, |seen| seen.slept_ns) });
        // From here to the turn are nanoseconds, as in `set_pace`.
        let now_ns = monotonic_ns();
        let goes_on = last.is_none_or(|last| last.at(now_ns).ns <= record.at(now_ns).ns);
        if goes_on {
            page.index.publish();
        }
        goes_on
    }

    /// Goes on in the same epoch with another pace, never back. False when the pace stays as it was: this thread was
    /// held up each time it tried.
    pub fn set_pace(&mut self, pace: f64) -> bool {
        let page: &TimePage = self.mapping.at(0);
        let Some(Written { record: last, slept_ns }) = page.read() else { return false };
        let pace_ppb = (pace.clamp(0.0, 1000.0) * 1e9) as u64;
        // Until the index turns, readers go by the old pace. So that the new record is never behind what they read till
        // then, a slower pace begins a little in the future.
        let lead_ns = if pace_ppb < last.pace_ppb { SLOWER_LEAD_NS } else { 0 };
        for _ in 0..WRITE_TRIES {
            let begin_ns = monotonic_ns() + lead_ns;
            let system_ns = last.at(begin_ns).ns;
            let record = TimeRecord { monotonic_ns: begin_ns, system_ns, pace_ppb, ..last };
            page.fill(&Written { record, slept_ns });
            // From here to the turn are nanoseconds; a thread held up just there for longer than the lead would be
            // late.
            if lead_ns == 0 || monotonic_ns() < begin_ns {
                page.index.publish();
                return true;
            }
        }
        false
    }
}
