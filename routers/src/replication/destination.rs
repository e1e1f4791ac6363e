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
    /// The record that is under way, and where its next part begins.
    pub(super) under_way: Option<(RecordInfo, usize)>,
    /// Where only changes are sent: the record that the node has, or is about to have, and when it was chosen, ns. None:
    /// the next one goes, whatever it is.
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
        let keep = reader.shape().map_or(0, |shape| u64::from(shape.keep));
        let (lost, mut next) = (&self.counts.lost, self.next.unwrap_or(newest.sequence));
        if self.under_way.is_none() && newest.sequence.saturating_sub(next) >= keep / 2 {
            lost.add(ReplicaLoss::Passed, newest.sequence.saturating_sub(next));
            next = newest.sequence;
        }
        while self.under_way.is_none() && next <= newest.sequence {
            let sequence = next;
            next += 1;
            let is_chosen = match sampling {
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
                let has_it = |(sent, at_ns): (Fingerprint, u64)| {
                    sent == fingerprint && now_ns.saturating_sub(at_ns) < UNCHANGED_EVERY_NS
                };
                if self.sent.is_some_and(has_it) {
                    lost.add(ReplicaLoss::Sampled, 1);
                    continue;
                }
                self.sent = Some((fingerprint, now_ns));
            }
            self.under_way = Some((record.info(), 0));
            if let Sampling::Rate(rate_hz) = sampling {
                self.sample_ns = now_ns.saturating_add((1e9 / rate_hz) as u64);
            }
        }
        self.next = Some(next);
        self.under_way.is_some()
    }

    /// It is not there, so nothing waits for it. Records from its first one on are counted.
    pub(super) fn pass_over(&mut self, newest: Option<&RecordInfo>) {
        (self.describing, self.sent) = (None, None);
        let (Some(newest), Some(next)) = (newest, self.next) else { return };
        let missed = (newest.sequence + 1).saturating_sub(next) + u64::from(self.under_way.take().is_some());
        self.next = Some(next.max(newest.sequence + 1));
        if missed > 0 {
            self.counts.lost.add(ReplicaLoss::Absent, missed);
        }
    }
}
