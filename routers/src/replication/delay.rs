//! How late records come, and a line of output when that is later than the configuration allows.

use super::counts::ReceivedReplica;
use super::gathering::Arriving;
use super::settings::ReplicaSettings;
use rohrpost_mailbox::{SystemTime, Throttle};
use std::time::Duration;

/// Late records of a replica are told this often at most.
const TOLD_EVERY_NS: u64 = 1_000_000_000;

/// Tells late records of one replica.
#[derive(Default)]
pub(super) struct DelayAlarm {
    told: Throttle,
}

impl DelayAlarm {
    /// Notes how late a record came that is in the replica now.
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
        if delay_ns <= settings.delay_alarm_ns.saturating_add(error_ns) {
            return;
        }
        counts.delayed.add(1);
        if let Some(records) = self.told.note(now_ns, TOLD_EVERY_NS) {
            let [delay, alarm] = [delay_ns, settings.delay_alarm_ns].map(Duration::from_nanos);
            tracing::warn!(
                "{records} records of {} came more than {alarm:?} after they were written, the last after {delay:?}",
                settings.stream
            );
        }
    }
}
