//! A place in a stream: how far one node's replica has come.

use super::counts::{ReplicaLoss, SentReplica};
use super::fingerprint::{Fingerprint, Fingerprints};
use crate::frame::NodeIndex;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{RecordInfo, StreamReader};
use std::sync::Arc;

/// Where only changes are sent, a record like the last one goes after this time nevertheless: that one may have been
/// lost on its way, and nobody says so.
pub(super) const UNCHANGED_EVERY_NS: u64 = 10_000_000_000;

/// A node that has the replica.
pub(super) struct Destination {
    pub(super) peer: NodeIndex,
    pub(super) counts: Arc<SentReplica>,
    /// Incarnation of its router that was last seen.
    pub(super) incarnation: u64,
    /// Sequence of its next record; none: the newest.
    pub(super) next: Option<u64>,
    /// It was not there when it was looked for last.
    pub(super) is_absent: bool,
    /// Its next record goes whatever the sampling: it may have none.
    pub(super) has_none: bool,
    /// The record that is under way, and where its next part begins.
    pub(super) under_way: Option<(RecordInfo, usize)>,
    /// Where only changes are sent: the record that went last, or is under way, and when it was chosen, ns. None: the
    /// next one goes, whatever its bytes.
    pub(super) sent: Option<(Fingerprint, u64)>,
    /// No further record is chosen before, ns.
    pub(super) sample_ns: u64,
    /// When the description is due, ns.
    pub(super) describe_ns: u64,
    /// Where its next part begins, if it is under way.
    pub(super) describing: Option<usize>,
}

impl Destination {
    pub(super) fn new(place: u16, peer: NodeIndex) -> Self {
        Self {
            peer,
            counts: Arc::new(SentReplica::new(place, peer)),
            incarnation: 0,
            next: None,
            is_absent: true,
            has_none: true,
            under_way: None,
            sent: None,
            sample_ns: 0,
            describe_ns: 0,
            describing: None,
        }
    }

    /// Whether a record is under way; if none is, takes the next. `fingerprints`: only of those that changed.
    pub(super) fn begin(
        &mut self,
        now_ns: u64,
        reader: &mut StreamReader,
        newest: &RecordInfo,
        (sampling, mut fingerprints): (Sampling, Option<&mut Fingerprints>),
    ) -> bool {
        let Some(keep) = reader.shape().map(|shape| u64::from(shape.keep)) else { return false };
        let (lost, mut next) = (&self.counts.lost, self.next.unwrap_or(newest.sequence));
        if self.under_way.is_none() && newest.sequence.saturating_sub(next) >= keep / 2 {
            // Of one in so many: the newest of them.
            let behind = match sampling {
                Sampling::Every(every) if !self.has_none => newest.sequence % u64::from(every.max(1)),
                _ => 0,
            };
            let newest = (newest.sequence - behind).max(next);
            lost.add(ReplicaLoss::Passed, newest - next);
            next = newest;
        }
        while self.under_way.is_none() && next <= newest.sequence {
            let sequence = next;
            next += 1;
            let is_chosen = match sampling {
                _ if self.has_none => true,
                Sampling::Each => true,
                Sampling::Every(every) => sequence.is_multiple_of(u64::from(every.max(1))),
                Sampling::Rate(_) => now_ns >= self.sample_ns,
            };
            if !is_chosen {
                lost.add(ReplicaLoss::Sampled, 1);
                continue;
            }
            let Some(record) = reader.record(sequence) else {
                lost.add(ReplicaLoss::Passed, 1);
                continue;
            };
            if let Some(fingerprints) = &mut fingerprints {
                let fingerprint = fingerprints.of(&record);
                let is_sent = |(sent, at_ns): (Fingerprint, u64)| {
                    sent == fingerprint && now_ns.saturating_sub(at_ns) < UNCHANGED_EVERY_NS
                };
                if !self.has_none && self.sent.is_some_and(is_sent) {
                    lost.add(ReplicaLoss::Sampled, 1);
                    continue;
                }
                self.sent = Some((fingerprint, now_ns));
            }
            (self.under_way, self.has_none) = (Some((record.info(), 0)), false);
            if let Sampling::Rate(rate_hz) = sampling {
                self.sample_ns = now_ns.saturating_add((1e9 / rate_hz) as u64);
            }
        }
        self.next = Some(next);
        self.under_way.is_some()
    }

    /// It is there; after an absence it may have missed anything, so the description and the newest record are for it.
    pub(super) fn come(&mut self) {
        if std::mem::replace(&mut self.is_absent, false) {
            (self.has_none, self.describe_ns) = (true, 0);
        }
    }

    /// It is not there, so nothing waits for it but the newest record. Older ones, from its first one on, are counted.
    pub(super) fn pass_over(&mut self, newest: Option<&RecordInfo>) {
        (self.describing, self.is_absent) = (None, true);
        let (Some(newest), Some(next)) = (newest, self.next) else { return };
        let given_up = self.under_way.take().is_some_and(|(record, _)| record.sequence < newest.sequence);
        let missed = newest.sequence.saturating_sub(next) + u64::from(given_up);
        self.next = Some(newest.sequence);
        if missed > 0 {
            self.counts.lost.add(ReplicaLoss::Absent, missed);
        }
    }
}
