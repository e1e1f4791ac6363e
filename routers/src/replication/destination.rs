//! A place in a stream: how far one node's replica has come.

use super::again::Again;
use super::counts::{ReplicaLoss, SentReplica};
use crate::frame::{NodeIndex, PartRequest};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{RecordInfo, StreamReader};
use std::sync::Arc;

/// Parts of so many records, the last that were begun, may be asked for. Only of two at a time something is missing
/// there; the others are on their way.
const ASKED_MAX: usize = 32;

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
    /// Sequence of the record of which all parts left last.
    pub(super) before: Option<u64>,
    /// Sequences of the records that were begun last, in any order.
    begun: [Option<u64>; ASKED_MAX],
    /// How many were.
    begins: usize,
    /// What it has asked for: of the record that arrives there, and of the one before.
    again: [Again; 2],
    /// No further record is chosen before, ns.
    pub(super) sample_ns: u64,
    /// When the description is due, ns.
    pub(super) describe_ns: u64,
    /// Where its next part begins, if it is under way.
    pub(super) describing: Option<usize>,
}

impl Destination {
    /// `parts`: most of a record.
    pub(super) fn new(place: u16, peer: NodeIndex, parts: usize) -> Self {
        Self {
            peer,
            counts: Arc::new(SentReplica::new(place, peer)),
            incarnation: 0,
            next: None,
            under_way: None,
            before: None,
            begun: [None; ASKED_MAX],
            begins: 0,
            again: std::array::from_fn(|_| Again::new(parts)),
            sample_ns: 0,
            describe_ns: 0,
            describing: None,
        }
    }

    /// Whether a record is under way; if none is, takes the next.
    pub(super) fn begin(
        &mut self,
        now_ns: u64,
        reader: &mut StreamReader,
        newest: &RecordInfo,
        sampling: Sampling,
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
            self.under_way = Some((record.info(), 0));
            self.begun[self.begins % ASKED_MAX] = Some(sequence);
            self.begins = self.begins.wrapping_add(1);
            if let Sampling::Rate(rate_hz) = sampling {
                self.sample_ns = now_ns.saturating_add((1e9 / rate_hz) as u64);
            }
        }
        self.next = Some(next);
        self.under_way.is_some()
    }

    /// Nothing that was sent counts any more: its records are others, or the node has none of them.
    pub(super) fn begin_anew(&mut self) {
        (self.under_way, self.before, self.begun) = (None, None, [None; ASKED_MAX]);
        self.again.iter_mut().for_each(Again::clear);
    }

    /// Takes a request for parts of this stream, as it is now.
    ///
    /// # Errors
    /// Why none of them is sent.
    pub(super) fn ask(
        &mut self,
        reader: &mut StreamReader,
        request: &PartRequest,
        part_bytes: usize,
    ) -> Result<(), ReplicaLoss> {
        let sequence = request.sequence;
        if !self.begun.contains(&Some(sequence)) {
            return Err(ReplicaLoss::NotSent);
        }
        let of = |again: &Again| again.record().map(|record| record.sequence);
        let at = match self.again.iter().position(|again| of(again) == Some(sequence)) {
            Some(at) => at,
            None => {
                // A newer record takes the place of an older one, never the other way round: else the bound on what
                // leaves again would begin anew.
                let at = usize::from(of(&self.again[0]) > of(&self.again[1]));
                if of(&self.again[at]) > Some(sequence) {
                    return Err(ReplicaLoss::NotSent);
                }
                let record = reader.record(sequence).ok_or(ReplicaLoss::Overwritten)?;
                self.again[at].begin(record.info(), parts_of(&record.info(), part_bytes));
                at
            }
        };
        let again = &mut self.again[at];
        let parts = again.record().map_or(0, |record| parts_of(record, part_bytes));
        if request.asked().any(|index| index >= parts) {
            return Err(ReplicaLoss::OutOfRange);
        }
        // What has not left yet comes by itself.
        let under_way = self.under_way.filter(|(record, _)| record.sequence == sequence);
        let sent = under_way.map_or(parts, |(_, offset)| offset / part_bytes);
        let refused = request.asked().filter(|index| *index < sent && !again.want(*index)).count();
        if refused > 0 {
            self.counts.lost.add(ReplicaLoss::Exhausted, refused as u64);
        }
        Ok(())
    }

    /// The part to send again, and its record: of the older one first.
    pub(super) fn next_again(&self) -> Option<(RecordInfo, usize)> {
        self.again.iter().filter_map(Again::next).min_by_key(|(record, _)| record.sequence)
    }

    /// Whether something is to be sent again.
    pub(super) fn is_asked(&self) -> bool {
        self.again.iter().any(Again::is_wanted)
    }

    /// A part was sent again.
    pub(super) fn sent_again(&mut self, sequence: u64, index: usize) {
        if let Some(again) = self.again_of(sequence) {
            again.left(index);
            self.counts.again.add(1);
        }
    }

    /// The record that is under way was overwritten, or one of which parts are to be sent again.
    pub(super) fn is_overwritten(&mut self, again: Option<u64>) {
        let cause = match again {
            Some(sequence) => {
                self.again_of(sequence).into_iter().for_each(Again::drop_wanted);
                ReplicaLoss::Overwritten
            }
            None => {
                self.under_way = None;
                ReplicaLoss::Passed
            }
        };
        self.counts.lost.add(cause, 1);
    }

    fn again_of(&mut self, sequence: u64) -> Option<&mut Again> {
        self.again.iter_mut().find(|again| again.record().is_some_and(|record| record.sequence == sequence))
    }

    /// It is not there, so nothing waits for it. Records from its first one on are counted.
    pub(super) fn pass_over(&mut self, newest: Option<&RecordInfo>) {
        self.describing = None;
        self.again.iter_mut().for_each(Again::drop_wanted);
        let (Some(newest), Some(next)) = (newest, self.next) else { return };
        let missed = (newest.sequence + 1).saturating_sub(next) + u64::from(self.under_way.take().is_some());
        self.next = Some(next.max(newest.sequence + 1));
        if missed > 0 {
            self.counts.lost.add(ReplicaLoss::Absent, missed);
        }
    }
}

/// Parts of a record.
fn parts_of(record: &RecordInfo, part_bytes: usize) -> usize {
    record.len_bytes.div_ceil(part_bytes).max(1)
}
