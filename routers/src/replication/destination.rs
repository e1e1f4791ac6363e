//! A place in a stream: how far one node's replica has come.

use super::again::{Again, AskedPart};
use super::counts::{ReplicaLoss, SentReplica};
use super::fingerprint::{Fingerprint, Fingerprints};
use crate::frame::{NodeIndex, PartRequest};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Missed, RecordInfo, StreamReader};
use std::sync::Arc;

/// Where only changes are sent, a record like the last one goes after this time nevertheless: that one may have been
/// lost for good, and nobody says so.
pub(super) const UNCHANGED_EVERY_NS: u64 = 10_000_000_000;
/// Parts of so many records, the last that were begun, may be asked for. Only of two at a time something is missing
/// there; the others are on their way.
const ASKED_MAX: usize = 32;

/// A node that has the replica.
#[derive(Default)]
pub(super) struct Destination {
    pub(super) peer: NodeIndex,
    pub(super) counts: Arc<SentReplica>,
    /// It is reached by a line on which nothing is lost, and which may be slow: a record is held until all of it left,
    /// and then the newest is next.
    pub(super) by_line: bool,
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
    /// Sequence of the record of which all parts left last.
    pub(super) before: Option<u64>,
    /// Records that were sampled out for it, here or on the way to this node, modulo 2^32.
    pub(super) sampled: u32,
    /// What this node's ring has left out before the record that was begun last; none: not known.
    left_out: Option<Missed>,
    /// The records that were begun last, in any order: each sequence, and what was sampled out before it.
    begun: [Option<(u64, u32)>; ASKED_MAX],
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
    pub(super) fn new(place: u16, peer: NodeIndex, parts: usize, by_line: bool) -> Self {
        let counts = Arc::new(SentReplica::new(place, peer));
        let again = std::array::from_fn(|_| Again::new(parts));
        Self { peer, counts, by_line, is_absent: true, has_none: true, again, ..Self::default() }
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
        let (mut next, mut gone) = (self.next.unwrap_or(newest.sequence), 0);
        let behind_max = if self.by_line { 1 } else { keep / 2 };
        let waits = matches!(sampling, Sampling::Rate(_)) && now_ns < self.sample_ns && !self.has_none;
        if self.under_way.is_none() && newest.sequence.saturating_sub(next) >= behind_max && !waits {
            (next, gone) = self.skip(next, newest.sequence, sampling);
        }
        while self.under_way.is_none() && next <= newest.sequence {
            let sequence = next;
            next += 1;
            if !self.is_chosen(now_ns, sequence, sampling) {
                self.sample_out(1);
                continue;
            }
            let is_there = !self.by_line || reader.keep(sequence).is_some();
            let left_out = reader.left_out_before(sequence);
            let Some(record) = reader.record(sequence).filter(|_| is_there) else {
                gone += 1;
                continue;
            };
            if fingerprints.as_mut().is_some_and(|fingerprints| !self.has_changed(now_ns, fingerprints.of(&record))) {
                self.sample_out(1);
                continue;
            }
            (self.under_way, self.has_none) = (Some((record.info(), 0)), false);
            self.pass(std::mem::take(&mut gone), left_out);
            self.begun[self.begins % ASKED_MAX] = Some((sequence, self.sampled));
            self.begins = self.begins.wrapping_add(1);
            if let Sampling::Rate(rate_hz) = sampling {
                self.sample_ns = now_ns.saturating_add((1e9 / rate_hz) as u64);
            }
        }
        self.counts.lost.add(ReplicaLoss::Passed, gone);
        self.next = Some(next);
        self.under_way.is_some()
    }

    /// From the next record on to the newest one: that, or of one in so many the newest of them. And how many of those
    /// that would have been sent are passed over.
    fn skip(&mut self, next: u64, newest: u64, sampling: Sampling) -> (u64, u64) {
        let every = match sampling {
            Sampling::Every(every) if !self.has_none => u64::from(every.max(1)),
            _ => 1,
        };
        let newest = (newest - newest % every).max(next);
        let gone = newest.div_ceil(every) - next.div_ceil(every);
        self.sample_out(newest - next - gone);
        (newest, gone)
    }

    fn is_chosen(&self, now_ns: u64, sequence: u64, sampling: Sampling) -> bool {
        match sampling {
            _ if self.has_none => true,
            Sampling::Each => true,
            Sampling::Every(every) => sequence.is_multiple_of(u64::from(every.max(1))),
            Sampling::Rate(_) => now_ns >= self.sample_ns,
        }
    }

    /// Whether a record differs from the one that was sent last, or that was long ago; then this one is it.
    fn has_changed(&mut self, now_ns: u64, fingerprint: Fingerprint) -> bool {
        let is_same = |(sent, at_ns): (Fingerprint, u64)| {
            sent == fingerprint && now_ns.saturating_sub(at_ns) < UNCHANGED_EVERY_NS
        };
        if !self.has_none && self.sent.is_some_and(is_same) {
            return false;
        }
        self.sent = Some((fingerprint, now_ns));
        true
    }

    /// So many records are left out by the sampling here.
    fn sample_out(&mut self, records: u64) {
        self.counts.lost.add(ReplicaLoss::Sampled, records);
        self.sampled = self.sampled.wrapping_add(records as u32);
    }

    /// So many sequences before the record that begins are not sent. What its ring has left out is counted by the node
    /// that did so; the next node is told what was sampled out.
    fn pass(&mut self, gone: u64, left_out: Option<Missed>) {
        let before = std::mem::replace(&mut self.left_out, left_out);
        let between = left_out.zip(before).map_or_else(Missed::default, |(now, before)| now.since(&before));
        let sampled = between.sampled.min(gone);
        let lost = between.lost.min(gone - sampled);
        self.sampled = self.sampled.wrapping_add(sampled as u32);
        self.counts.lost.add(ReplicaLoss::Passed, gone - sampled - lost);
    }

    /// It is there; after an absence it may have missed anything, so the description and the newest record are for it.
    pub(super) fn come(&mut self) {
        if std::mem::replace(&mut self.is_absent, false) {
            (self.has_none, self.describe_ns) = (true, 0);
        }
    }

    /// Nothing that was sent counts any more: its records are others, or the node has none of them.
    pub(super) fn begin_anew(&mut self) {
        (self.under_way, self.sent, self.before, self.begun) = (None, None, None, [None; ASKED_MAX]);
        self.left_out = None;
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
        let begun = self.begun.iter().flatten().find(|(begun, _)| *begun == sequence);
        let Some(&(_, sampled)) = begun else { return Err(ReplicaLoss::NotSent) };
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
                let Some(record) = reader.record(sequence) else {
                    // It may not have what was sent last.
                    self.sent = None;
                    return Err(ReplicaLoss::Overwritten);
                };
                self.again[at].begin(record.info(), sampled, parts_of(&record.info(), part_bytes));
                at
            }
        };
        let again = &mut self.again[at];
        // A module may write larger records than the configuration of this router says: no node has them.
        let parts = again.record().map_or(0, |record| parts_of(record, part_bytes)).min(again.room());
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

    /// The part to send again: of the older record first.
    pub(super) fn next_again(&self) -> Option<AskedPart> {
        self.again.iter().filter_map(Again::next).min_by_key(|part| part.record.sequence)
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

    /// The record that is under way was overwritten, or one of which parts are to be sent again. Either way the node
    /// may not have what was sent last.
    pub(super) fn is_overwritten(&mut self, again: Option<u64>) {
        self.sent = None;
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

    /// It is not there, so nothing waits for it but the newest record. Older ones, from its first one on, are counted.
    pub(super) fn pass_over(&mut self, newest: Option<&RecordInfo>) {
        (self.describing, self.is_absent, self.left_out) = (None, true, None);
        self.again.iter_mut().for_each(Again::drop_wanted);
        let (Some(newest), Some(next)) = (newest, self.next) else { return };
        let given_up = self.under_way.take().is_some_and(|(record, _)| record.sequence < newest.sequence);
        let missed = newest.sequence.saturating_sub(next) + u64::from(given_up);
        self.next = Some(newest.sequence);
        if missed > 0 {
            self.counts.lost.add(ReplicaLoss::Absent, missed);
        }
    }
}

/// Parts of a record.
fn parts_of(record: &RecordInfo, part_bytes: usize) -> usize {
    record.len_bytes.div_ceil(part_bytes).max(1)
}
