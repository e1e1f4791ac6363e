//! Lines of output about records that came later than the configuration allows, or not at all.

use super::counts::ReceivedReplica;
use super::gathering::Arriving;
use super::settings::ReplicaSettings;
use rohrpost_mailbox::{SystemTime, Throttle};
use std::time::Duration;

/// Late or missing records of a replica are told this often at most.
const TOLD_EVERY_NS: u64 = 1_000_000_000;

/// Tells late records of one replica.
#[derive(Default)]
pub(super) struct DelayAlarm {
    told: Throttle,
    /// Of the last late one.
    delay_ns: u64,
}

impl DelayAlarm {
    /// Notes how late a record came that is in the replica now. Errors of both clocks leave out what is half of a round
    /// trip ([`OneWayClock`](super::OneWayClock)): a steady delay is part of each bound, and would never be told.
    pub(super) fn note(
        &mut self,
        now_ns: u64,
        system: &SystemTime,
        arriving: &Arriving,
        (settings, counts): (&ReplicaSettings, &ReceivedReplica),
    ) {
        if arriving.written_ns == 0 || system.epoch != arriving.record.stamp.epoch {
            return;
        }
        let delay_ns = system.ns.saturating_sub(arriving.written_ns);
        counts.delay.note(delay_ns);
        let error_ns = u64::try_from(system.error.as_nanos()).unwrap_or(u64::MAX);
        let error_ns = error_ns.saturating_add(arriving.error_ns.into());
        let is_late = delay_ns > settings.delay_alarm_ns.saturating_add(error_ns);
        if is_late {
            counts.delayed.add(1);
            self.delay_ns = delay_ns;
        }
        if let Some(records) = self.told.note_all(now_ns, TOLD_EVERY_NS, is_late.into()) {
            let [delay, alarm] = [self.delay_ns, settings.delay_alarm_ns].map(Duration::from_nanos);
            tracing::warn!(
                "{records} records of {} came more than {alarm:?} after they were written, the last after {delay:?}",
                settings.stream
            );
        }
    }
}

/// Notes how many records of a replica are missing before one that is in it now, and tells that.
pub(super) fn note_missing(told: &mut Throttle, now_ns: u64, records: u64, settings: &ReplicaSettings) {
    if let Some(records) = told.note_all(now_ns, TOLD_EVERY_NS, records) {
        tracing::warn!(
            "{records} records of {} are missing here: lost on the way, too late behind newer ones, or passed over \
             where they were written faster than the wire carries them (`rohrpost net` counts the causes)",
            settings.stream
        );
    }
}
