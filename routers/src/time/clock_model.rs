//! The line that a node's system time follows: the content of its page. Within an epoch it has no jump, only changes of
//! pace.

use super::{RATE_MAX_PPB, SLEW_MAX_PPB, WANDER_PPB_S};
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, SystemTime, TimeRecord, TimeSource};

/// A slower line begins this much in the future: readers use the old one until the new one is in the page.
const SLOWER_LEAD_NS: u64 = 1_000_000;
/// A page with a faster growing bound, ns a second, may be slewing: its pace does not show the clock's rate, and is
/// dropped.
const BENT_NS_S: u64 = 50_000;
/// Rounding error of lines until the source is heard again.
const ROUNDING_NS: u64 = 4;
pub(super) const BILLION: i128 = 1_000_000_000;
/// The pace of the local clock.
pub(super) const EVEN_PPB: u64 = 1_000_000_000;

/// The present record, and its next change.
#[derive(Debug)]
pub(super) struct ClockModel {
    record: TimeRecord,
    slew: Option<Slew>,
}

/// The line slews for a while.
#[derive(Clone, Copy, Debug)]
struct Slew {
    /// When slewing ends.
    end_ns: u64,
    /// The pace from then on.
    pace_ppb: u64,
    /// Extra growth of the bound until then, ns a second: the thread that ends the slew may die or stall.
    drift_ns_s: u64,
}

impl ClockModel {
    /// The wall clock, with unknown error.
    pub(super) fn unsynchronised(now_ns: u64, wall_ns: u64, epoch: u64) -> Self {
        let record = TimeRecord {
            epoch,
            source: TimeSource::Master,
            monotonic_ns: now_ns,
            system_ns: wall_ns,
            pace_ppb: EVEN_PPB,
            error_ns: ERROR_UNKNOWN_NS,
            drift_ns_s: 0,
        };
        Self { record, slew: None }
    }

    /// The page of an earlier incarnation of this router. A slave without updates may drift faster than was stated
    /// then; a master's time is the reference, and does not drift.
    pub(super) fn adopted(now_ns: u64, record: TimeRecord) -> Self {
        let age_ns = now_ns.saturating_sub(record.monotonic_ns);
        let drift_ns_s = record.drift_ns_s.saturating_add(wander_ns_s(age_ns)).min(2 * RATE_MAX_PPB.unsigned_abs());
        let drift_ns_s = if record.drift_ns_s == 0 { 0 } else { drift_ns_s.max(record.drift_ns_s) };
        let mut line = Self { record: TimeRecord { drift_ns_s, ..record }, slew: None };
        if record.drift_ns_s > BENT_NS_S {
            // Until the two lines meet, the new one differs from the old one.
            let bent_ppb = u128::from(record.pace_ppb.abs_diff(EVEN_PPB));
            let meets_ns = (bent_ppb * u128::from(SLOWER_LEAD_NS)).div_ceil(BILLION as u128) as u64 + ROUNDING_NS;
            let error_ns = line.error_ns(now_ns).saturating_add(meets_ns).min(ERROR_UNKNOWN_NS);
            line.turn(now_ns, now_ns, EVEN_PPB);
            line.restate(error_ns, drift_ns_s.max(RATE_MAX_PPB.unsigned_abs()));
        }
        line
    }

    pub(super) fn record(&self) -> &TimeRecord {
        &self.record
    }

    pub(super) fn at(&self, now_ns: u64) -> SystemTime {
        self.record.at(now_ns)
    }

    pub(super) fn is_synchronised(&self) -> bool {
        self.record.error_ns < ERROR_UNKNOWN_NS
    }

    pub(super) fn slew_end_ns(&self) -> Option<u64> {
        self.slew.map(|slew| slew.end_ns)
    }

    /// The bound just now, ns.
    pub(super) fn error_ns(&self, now_ns: u64) -> u64 {
        u64::try_from(self.at(now_ns).error.as_nanos()).unwrap_or(u64::MAX)
    }

    /// Begins another epoch, at another time.
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        epoch: u64,
        system_ns: u64,
        pace_ppb: u64,
        error_ns: u64,
        drift_ns_s: u64,
    ) {
        let source = TimeSource::Master;
        self.record = TimeRecord { epoch, source, monotonic_ns: now_ns, system_ns, pace_ppb, error_ns, drift_ns_s };
        self.slew = None;
    }

    /// Begins another epoch, at the same time.
    pub(super) fn rename(&mut self, epoch: u64) {
        self.record.epoch = epoch;
    }

    /// The source was heard. Slews the line by `by_ns` against `pace_ppb` within about `within_ns`, then continues with
    /// that pace. The bound holds for the present place and for the target.
    pub(super) fn bend(
        &mut self,
        now_ns: u64,
        by_ns: i64,
        within_ns: u64,
        pace_ppb: u64,
        error_ns: u64,
        drift_ns_s: u64,
    ) {
        let slew_ppb = i128::from(by_ns) * BILLION / i128::from(within_ns.max(1));
        let slew_ppb = slew_ppb.clamp(-i128::from(SLEW_MAX_PPB), i128::from(SLEW_MAX_PPB)) as i64;
        let slewed_ppb = pace_ppb.saturating_add_signed(slew_ppb);
        // A pace, which may be that of an earlier slew, becomes slower a lead late: at the beginning or at the end.
        let (begin_ppb, end_ppb) =
            (self.record.pace_ppb.saturating_sub(slewed_ppb), slewed_ppb.saturating_sub(pace_ppb));
        let late_ppb = u128::from(begin_ppb) + u128::from(end_ppb);
        let overshoot_ns = (late_ppb * u128::from(SLOWER_LEAD_NS)).div_ceil(BILLION as u128) as u64;
        let error_ns = error_ns.saturating_add(overshoot_ns).saturating_add(ROUNDING_NS);
        self.turn(now_ns, now_ns, slewed_ppb);
        let slew_drift_ns_s = slew_ppb.unsigned_abs();
        let error_ns = error_ns.min(ERROR_UNKNOWN_NS);
        self.record = TimeRecord { error_ns, drift_ns_s: drift_ns_s + slew_drift_ns_s, ..self.record };
        self.slew = (slew_ppb != 0).then(|| {
            let takes_ns = i128::from(by_ns) * BILLION / i128::from(slew_ppb);
            Slew { end_ns: now_ns.saturating_add(takes_ns as u64), pace_ppb, drift_ns_s: slew_drift_ns_s }
        });
    }

    /// Ends the slew when it is complete.
    pub(super) fn end_slew(&mut self, now_ns: u64) {
        if self.slew.is_some_and(|slew| slew.end_ns <= now_ns) {
            self.stop_slew(now_ns);
        }
    }

    /// Stops slewing wherever it is: past its target, if this node was stalled meanwhile.
    pub(super) fn stop_slew(&mut self, now_ns: u64) {
        if let Some(Slew { end_ns, pace_ppb, drift_ns_s }) = self.slew.take() {
            self.turn(now_ns, self.record.monotonic_ns, pace_ppb);
            self.record.drift_ns_s = self.record.drift_ns_s.saturating_sub(drift_ns_s);
            let late_ns = u128::from(now_ns.saturating_sub(end_ns));
            let beyond_ns = (late_ns * u128::from(drift_ns_s)).div_ceil(BILLION as u128) as u64;
            self.record.error_ns = self.record.error_ns.saturating_add(beyond_ns).min(ERROR_UNKNOWN_NS);
        }
    }

    /// From now on this line is the reference of the others: it cannot drift from itself.
    pub(super) fn become_reference(&mut self, now_ns: u64) {
        let error_ns = self.error_ns(now_ns).saturating_add(ROUNDING_NS).min(ERROR_UNKNOWN_NS - 1);
        self.turn(now_ns, now_ns, self.record.pace_ppb);
        self.restate(error_ns, 0);
    }

    /// Sets the growth of the bound.
    pub(super) fn restate(&mut self, error_ns: u64, drift_ns_s: u64) {
        self.record = TimeRecord { error_ns, drift_ns_s, ..self.record };
    }

    /// The page was not written in time, and still has this record: the line continues from there.
    pub(super) fn go_on_from(&mut self, now_ns: u64, page: &TimeRecord) {
        let wanted = self.record;
        if page.epoch == wanted.epoch {
            self.record = TimeRecord { error_ns: wanted.error_ns, drift_ns_s: wanted.drift_ns_s, ..*page };
            self.turn(now_ns, wanted.monotonic_ns, wanted.pace_ppb);
        }
    }

    /// Changes the pace at the present point of the line. Written as if the pace was so since `base_ns`, when the
    /// source was heard.
    fn turn(&mut self, now_ns: u64, base_ns: u64, pace_ppb: u64) {
        let lead_ns = if pace_ppb < self.record.pace_ppb { SLOWER_LEAD_NS } else { 0 };
        let meet_ns = now_ns.max(base_ns) + lead_ns;
        let since_base_ns = i128::from(meet_ns - base_ns) * i128::from(pace_ppb) / BILLION;
        // Two lines that meet are rounded differently: with one more it is never one less.
        let system_ns = i128::from(self.at(meet_ns).ns) + 1 - since_base_ns;
        let system_ns = u64::try_from(system_ns).unwrap_or(0);
        self.record = TimeRecord { monotonic_ns: base_ns, system_ns, pace_ppb, ..self.record };
    }
}

/// Growth of a bound, ns a second, without an update for so long: the rate may change meanwhile.
pub(super) fn wander_ns_s(span_ns: u64) -> u64 {
    let ns_s = u128::from(span_ns) * WANDER_PPB_S as u128 / 2 / BILLION as u128;
    u64::try_from(ns_s).unwrap_or(u64::MAX).saturating_add(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slew_that_another_one_ends_counts_for_the_bound_until_the_pace_has_changed() {
        let (begin_ns, ahead_ns, within_ns) = (1_000_000_000, 600_000, 2_000_000_000);
        let mut line = ClockModel::unsynchronised(begin_ns, begin_ns, 0);
        line.step(begin_ns, 1, begin_ns, EVEN_PPB, 0, 0);
        line.bend(begin_ns, ahead_ns, within_ns, EVEN_PPB, ahead_ns.unsigned_abs(), 0);
        // On the way there an exact source says that the line is right now.
        let now_ns = begin_ns + within_ns / 2;
        let true_ns = line.at(now_ns).ns;
        line.bend(now_ns, 0, within_ns, EVEN_PPB, 0, 0);
        for later_ns in [0, SLOWER_LEAD_NS / 2, SLOWER_LEAD_NS, 10 * SLOWER_LEAD_NS] {
            let off_ns = line.at(now_ns + later_ns).ns.abs_diff(true_ns + later_ns);
            let error_ns = line.error_ns(now_ns + later_ns);
            assert!(off_ns <= error_ns, "{off_ns} ns off after {later_ns} ns, bound {error_ns}");
            assert!(error_ns < 1_000, "the lead alone: {error_ns}");
        }
    }

    #[test]
    fn a_line_that_is_straightened_late_says_how_far_it_went_too_far() {
        let (begin_ns, by_ns, within_ns) = (1_000_000_000, 500_000, 500_000_000);
        for late_ns in [0, 1_000_000, 900_000_000] {
            let mut line = ClockModel::unsynchronised(begin_ns, begin_ns, 0);
            line.step(begin_ns, 1, begin_ns, EVEN_PPB, 0, 0);
            line.bend(begin_ns, by_ns, within_ns, EVEN_PPB, by_ns.unsigned_abs(), 0);
            let now_ns = begin_ns + within_ns + late_ns;
            line.end_slew(now_ns);
            // The bound covers start and target: the truth may be at either.
            let off_ns = line.at(now_ns).ns.abs_diff(now_ns);
            assert!(off_ns >= by_ns.unsigned_abs() + late_ns / 1_000, "it went too far: {off_ns}");
            assert!(line.error_ns(now_ns) >= off_ns, "{off_ns} ns off after {late_ns} ns: {:?}", line.record());
        }
    }
}
