//! Whether what routers count of replicas adds up: on the node that writes, on those that read, and between them.

use super::books::body;
use super::rings::Rings;
use crate::sim::promise::Promise;
use crate::sim::spans::{MS, S};
use crate::sim::station::Io;
use rohrpost_config::Sampling;
use rohrpost_mailbox::StreamInfo;
use rohrpost_routers::replication::{ReceivedReplica, ReplicaLoss, SentReplica};
use std::sync::Arc;

/// What one incarnation of a router counts.
pub(super) struct Accounts {
    sent: Vec<SentAccount>,
    received: Vec<ReceivedAccount>,
}

struct SentAccount {
    counts: Arc<SentReplica>,
    /// Since all is well: records that were written, and what became of them.
    well: Option<(u64, RecordSums)>,
}

/// What became of records at their origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordSums {
    pub(super) sent: u64,
    pub(super) not_sent: u64,
}

struct ReceivedAccount {
    counts: Arc<ReceivedReplica>,
    /// With which sequence the replica began for this router, and how often it has begun anew since.
    first: Option<(u64, u32)>,
    /// Records that came whole, since all is well.
    well: Option<u64>,
}

impl RecordSums {
    pub(super) fn of(counts: &SentReplica) -> Self {
        let causes = [ReplicaLoss::Sampled, ReplicaLoss::Passed, ReplicaLoss::Absent];
        let not_sent = causes.into_iter().map(|cause| counts.lost.of(cause)).sum();
        Self { sent: counts.records.get(), not_sent }
    }
}

impl Accounts {
    pub(super) fn new(sent: Vec<Arc<SentReplica>>, received: Vec<Arc<ReceivedReplica>>) -> Self {
        let sent = sent.into_iter().map(|counts| SentAccount { counts, well: None }).collect();
        let received = received.into_iter().map(|counts| ReceivedAccount { counts, first: None, well: None }).collect();
        Self { sent, received }
    }

    pub(super) fn check(&mut self, io: &mut Io<'_>, rings: &Rings, well: bool) {
        for sent in &mut self.sent {
            sent.check(io, well);
        }
        for received in &mut self.received {
            received.check(io, rings, well);
        }
    }

    pub(super) fn close(&mut self, io: &mut Io<'_>, rings: &Rings) {
        for sent in &self.sent {
            sent.close(io);
        }
        for received in &self.received {
            received.close(io, rings);
        }
        let (found, most) = (rings.node(io.node).streams().map_or(0, |all| all.len()), io.plan.streams.len());
        if found > most {
            let text = format!("node {} has {found} streams, of {most}", io.node);
            io.oracle.broken(io.now, Promise::RecordBounds, text);
        }
    }
}

impl SentAccount {
    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        let written = io.oracle.records.streams[usize::from(self.counts.place)].count;
        let now = (written, RecordSums::of(&self.counts));
        self.well = if well { self.well.or(Some(now)) } else { None };
    }

    /// Nothing is under way any more: each record was sent, or is counted with a cause. No record is both: that is
    /// seen where it leaves.
    fn close(&self, io: &mut Io<'_>) {
        let Some((written_before, before)) = self.well else { return };
        let place = usize::from(self.counts.place);
        let (written, now) = (io.oracle.records.streams[place].count, RecordSums::of(&self.counts));
        let (more, accounted) = (written - written_before, now.sent + now.not_sent - before.sent - before.not_sent);
        if accounted < more {
            let text = format!(
                "of {more} records of stream {place} {accounted} were sent to node {}, or are counted with a cause: \
                 {now:?}, {before:?} before",
                self.counts.to
            );
            io.oracle.broken(io.now, Promise::RecordAccounts, text);
        }
        io.oracle.records.sent.insert((self.counts.place, self.counts.to), now.sent - before.sent);
    }
}

impl ReceivedAccount {
    fn ring(&self, io: &Io<'_>, rings: &Rings) -> Option<StreamInfo> {
        let id = io.plan.streams[usize::from(self.counts.place)].id;
        rings.node(io.node).inspect_stream(id).ok().flatten()
    }

    /// What came whole, and what readers are told to have lost, is all that there was since the replica began.
    fn check(&mut self, io: &mut Io<'_>, rings: &Rings, well: bool) {
        let counts = &self.counts;
        let came = counts.records.get();
        self.well = if well { self.well.or(Some(came)) } else { None };
        let Some(ring) = self.ring(io, rings).filter(|_| came > 0) else { return };
        let told = came + counts.gaps.get();
        let first = ring.written.wrapping_sub(told);
        let changes = io.oracle.records.streams[usize::from(counts.place)].changes;
        let (before, begins) = *self.first.get_or_insert((first, 0));
        if first != before && begins < changes {
            self.first = Some((first, begins + 1));
        } else if first != before {
            let text = format!(
                "node {} counts {told} records of stream {} that came or are missing, and the ring is at {}; it began \
                 with {before}",
                io.node, counts.place, ring.written
            );
            io.oracle.broken(io.now, Promise::RecordAccounts, text);
        }
    }

    /// All that was sent while all was well has come, and the newest record that is to be there is.
    fn close(&self, io: &mut Io<'_>, rings: &Rings) {
        if let Some(before) = self.well {
            let key = (self.counts.place, io.node as u8);
            io.oracle.records.came.insert(key, self.counts.records.get() - before);
        }
        if let Err(text) = self.is_up_to_date(io, rings) {
            let text = format!("stream {} on node {}: {text}", self.counts.place, io.node);
            io.oracle.broken(io.now, Promise::Recovery, text);
        }
    }

    fn is_up_to_date(&self, io: &Io<'_>, rings: &Rings) -> Result<(), String> {
        let place = usize::from(self.counts.place);
        let (its, books) = (&io.plan.streams[place], &io.oracle.records);
        let Some((sequence, newest)) = books.newest(place).filter(|_| its.is_carried) else { return Ok(()) };
        let Some(there) = self.ring(io, rings).and_then(|ring| ring.newest) else {
            return Err(format!("{sequence} was written, and none came"));
        };
        let came = books.get(place, there.incarnation, there.sequence).ok_or("nobody wrote the newest")?;
        let is_there = match its.sampling {
            _ if came.generation != newest.generation => false,
            _ if there.sequence == sequence => true,
            Sampling::Each => its.changed && body(came.start, came.len) == body(newest.start, newest.len),
            // Of these not all differ from the one before.
            Sampling::Every(every) => its.changed || there.sequence + u64::from(every) > sequence,
            Sampling::Rate(rate_hz) => {
                let pause_ns = (S as f64 / rate_hz) as u64 + 2 * its.period_ns + 500 * MS;
                its.changed || came.at_ns + pause_ns > newest.at_ns
            }
        };
        if is_there { Ok(()) } else { Err(format!("{sequence} was written last, {newest:?}, and {there:?} came last")) }
    }
}
