//! The receiving half: parts become records of this node's rings.
//!
//! ```text
//!  part ─▶ described? ─▶ fits? ─▶ of the record that is begun? ─┬─ yes ───────────▶ put ─▶ all there: a record
//!          undescribed   too-large, unsound                     └ newer: begin it   another is given up: incomplete
//!                                                                 older: late, duplicate; or the origin was made anew
//! ```
//!
//! Records are known by sequence, incarnation and stamp, never by when they come. A sequence does not go back, unless
//! the origin's router says in a later life that its stream was made anew: then so is the replica.

use super::assembly::DescriptionAssembly;
use super::counts::{ReceivedReplica, ReplicaLoss};
use super::settings::ReplicaSettings;
use super::{Describe, part_bytes};
use crate::frame::{DescriptionPart, FrameHead, RecordPart, ReplicaFrame};
use crate::settings::Settings;
use rohrpost_mailbox::{
    Name, NodeError, OriginRecord, Participant, RecordInfo, ReplicaWriter, STREAM_SEQUENCE_MAX, Stamp, StreamId,
    SystemTime, Throttle,
};
use std::sync::Arc;
use std::time::Duration;

/// A ring that cannot be made is tried again after this, ns.
const RETRY_NS: u64 = 1_000_000_000;
/// Late records of a replica are told this often at most.
const DELAY_TOLD_EVERY_NS: u64 = 1_000_000_000;

/// The receiving half of all replicas of a node. One thread has it.
pub struct ReplicaReceiver {
    part_bytes: usize,
    participant: Arc<Participant>,
    describe: Arc<dyn Describe>,
    /// By place in the configuration; none: this node has no such replica.
    streams: Vec<Option<IncomingReplica>>,
}

/// What the sender of parts may count sequences from anew.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Life {
    /// Incarnation of the router.
    router: u64,
    /// How often that has seen the stream made anew.
    generation: u16,
}

impl Life {
    /// Whether the same router says that this ended. As it wraps: earlier by less than half of all numbers.
    fn is_before(self, other: Self) -> bool {
        self.router == other.router && (other.generation.wrapping_sub(self.generation) as i16) > 0
    }
}

struct IncomingReplica {
    settings: ReplicaSettings,
    counts: Arc<ReceivedReplica>,
    assembly: DescriptionAssembly,
    known: Option<KnownOrigin>,
    /// What the description that came last says: of which life, and how many records were written.
    announced: Option<(Life, u64)>,
    writer: Option<ReplicaWriter>,
    /// Of the newest record; none: it was written before this router began.
    life: Option<Life>,
    /// Of the record that is begun.
    begun_in: Option<Life>,
    /// Parts of the begun record that have come, one bit each.
    came: Box<[u64]>,
    /// How many have not.
    missing: usize,
    /// The ring could not be opened or made.
    is_unopened: bool,
    /// It is not tried again before, ns.
    retry_ns: u64,
    /// What is wrong with it was told.
    told: bool,
    delays_told: Throttle,
}

/// What is known of a stream by the description of its module.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct KnownOrigin {
    check: u32,
    id: StreamId,
}

impl ReplicaReceiver {
    /// Of all `replicas` those that this node has. Rings are made when their first record comes.
    pub fn new(
        settings: &Settings,
        replicas: &[ReplicaSettings],
        participant: Arc<Participant>,
        describe: Arc<dyn Describe>,
    ) -> Self {
        let part_bytes = part_bytes(settings);
        let incoming = |(place, replica): (u16, &ReplicaSettings)| {
            let is_here = replica.to & 1 << settings.own != 0 && replica.node != settings.own;
            is_here.then(|| IncomingReplica::new(place, replica, part_bytes))
        };
        Self { part_bytes, participant, describe, streams: (0..).zip(replicas).map(incoming).collect() }
    }

    /// Whether this node has no replica.
    pub fn is_empty(&self) -> bool {
        self.streams.iter().all(Option::is_none)
    }

    /// Counters of each replica.
    pub fn counts(&self) -> Vec<Arc<ReceivedReplica>> {
        self.streams.iter().flatten().map(|stream| stream.counts.clone()).collect()
    }

    /// Takes a part from a datagram with this head; false when this node has no such replica. `system` tells system
    /// time now.
    pub fn take(
        &mut self,
        now_ns: u64,
        system: impl Fn() -> SystemTime,
        head: &FrameHead,
        part: &ReplicaFrame<'_>,
    ) -> bool {
        let Some(Some(stream)) = self.streams.get_mut(usize::from(part.place())) else { return false };
        if stream.settings.node != head.from {
            stream.counts.lost.add(ReplicaLoss::Foreign, 1);
            return true;
        }
        match part {
            ReplicaFrame::Record(part) => {
                let life = Life { router: head.incarnation, generation: part.generation };
                if now_ns < stream.retry_ns {
                    stream.counts.lost.add(ReplicaLoss::Unwritable, 1);
                } else if stream.take(&self.participant, life, part, self.part_bytes) {
                    stream.note_delay(now_ns, &system(), part);
                } else if std::mem::take(&mut stream.is_unopened) {
                    stream.retry_ns = now_ns + RETRY_NS;
                }
            }
            ReplicaFrame::Description(part) => self.describe(head.incarnation, part),
        }
        true
    }

    fn describe(&mut self, router: u64, part: &DescriptionPart<'_>) {
        let Some(Some(stream)) = self.streams.get_mut(usize::from(part.place)) else { return };
        let life = Life { router, generation: part.generation };
        if stream.is_over(life) {
            return;
        }
        stream.announced = Some((life, part.written));
        if stream.known.is_some_and(|known| known.check == part.check) {
            return;
        }
        let Some(words) = stream.assembly.take(part) else { return };
        let Some(number) = self.describe.number(&words, &stream.settings.item) else {
            stream.counts.lost.add(ReplicaLoss::Undescribed, 1);
            return stream.tell("the description that came with it names no such stream");
        };
        let name = stream.settings.from;
        let laid = self.lay_down(name, &words);
        let Some(Some(stream)) = self.streams.get_mut(usize::from(part.place)) else { return };
        match laid {
            Ok(()) => {
                stream.writer = None;
                stream.known = Some(KnownOrigin { check: part.check, id: StreamId { name, number } });
                stream.told = false;
            }
            Err(error) => stream.tell(&error.to_string()),
        }
    }

    /// Lays a module's description down here, unless it is there. Records that were written by another one are not read
    /// by this one: their rings go.
    fn lay_down(&mut self, module: Name, words: &[u8]) -> Result<(), NodeError> {
        let node = self.participant.node();
        if node.about(module).as_deref() == Some(words) {
            return Ok(());
        }
        for stream in self.streams.iter_mut().flatten().filter(|stream| stream.settings.from == module) {
            (stream.writer, stream.known) = (None, None);
        }
        for id in node.streams()?.into_iter().filter(|id| id.name == module) {
            node.remove_orphan_stream(id)?;
        }
        self.participant.describe_replicas(module, words)
    }
}

impl IncomingReplica {
    fn new(place: u16, replica: &ReplicaSettings, part_bytes: usize) -> Self {
        let parts = (replica.shape.record_bytes as usize).div_ceil(part_bytes);
        Self {
            settings: replica.clone(),
            counts: Arc::new(ReceivedReplica::new(place)),
            assembly: DescriptionAssembly::default(),
            known: None,
            announced: None,
            writer: None,
            life: None,
            begun_in: None,
            came: vec![0; parts.div_ceil(64)].into(),
            missing: 0,
            is_unopened: false,
            retry_ns: 0,
            told: false,
            delays_told: Throttle::default(),
        }
    }

    fn tell(&mut self, why: &str) {
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!(
                "the replica of {} of {} is not written for now: {why}",
                self.settings.item,
                self.settings.from
            );
        }
    }

    /// Counts a part or record that is not taken: it makes nothing whole.
    fn lose(&self, cause: ReplicaLoss) -> bool {
        self.counts.lost.add(cause, 1);
        false
    }

    /// Notes how late a record came that is whole now.
    fn note_delay(&mut self, now_ns: u64, now: &SystemTime, part: &RecordPart<'_>) {
        if part.written_ns == 0 || now.epoch != part.epoch {
            return;
        }
        let delay_ns = now.ns.saturating_sub(part.written_ns);
        self.counts.delay.note(delay_ns);
        let error_ns = u64::try_from(now.error.as_nanos()).unwrap_or(u64::MAX).saturating_add(part.error_ns.into());
        if delay_ns <= self.settings.delay_alarm_ns.saturating_add(error_ns) {
            return;
        }
        self.counts.delayed.add(1);
        if let Some(records) = self.delays_told.note(now_ns, DELAY_TOLD_EVERY_NS) {
            let [delay, alarm] = [delay_ns, self.settings.delay_alarm_ns].map(Duration::from_nanos);
            tracing::warn!(
                "{records} records of {} of {} came more than {alarm:?} after they were written, the last after \
                 {delay:?}",
                self.settings.item,
                self.settings.from
            );
        }
    }

    /// Takes a part; whether its record is whole with it.
    fn take(&mut self, participant: &Arc<Participant>, life: Life, part: &RecordPart<'_>, part_bytes: usize) -> bool {
        let Some(known) = self.known.filter(|known| known.check == part.description) else {
            return self.lose(ReplicaLoss::Undescribed);
        };
        if part.len > self.settings.shape.record_bytes {
            return self.lose(ReplicaLoss::TooLarge);
        }
        let (len, offset) = (part.len as usize, part.offset as usize);
        let whole = part_bytes.min(len.saturating_sub(offset));
        if !offset.is_multiple_of(part_bytes)
            || part.bytes.len() != whole
            || part.stamp_ns == 0
            || part.sequence > STREAM_SEQUENCE_MAX
        {
            return self.lose(ReplicaLoss::Unsound);
        }
        if self.is_over(life) {
            return self.lose(ReplicaLoss::Late);
        }
        let record = OriginRecord {
            sequence: part.sequence,
            incarnation: part.incarnation,
            stamp: Stamp { epoch: part.epoch, ns: part.stamp_ns },
            len_bytes: len,
        };
        let is_begun = self.begun() == Some(record) && self.begun_in == Some(life);
        (is_begun || self.begin(participant, known.id, life, record, part_bytes))
            && self.put(offset / part_bytes, offset, part.bytes)
    }

    /// Whether the stream was made anew since, as its router has said.
    fn is_over(&self, life: Life) -> bool {
        let announced = self.announced.map(|(life, _)| life);
        [announced, self.life, self.begun_in].into_iter().flatten().any(|known| life.is_before(known))
    }

    fn begun(&self) -> Option<OriginRecord> {
        self.writer.as_ref().and_then(ReplicaWriter::open)
    }

    /// Begins a record, if it is newer than all before; what was begun is given up.
    fn begin(
        &mut self,
        participant: &Arc<Participant>,
        id: StreamId,
        life: Life,
        record: OriginRecord,
        part_bytes: usize,
    ) -> bool {
        let begun = self.begun();
        if begun.is_some_and(|begun| self.begun_in == Some(life) && record.sequence <= begun.sequence) {
            return self.lose(ReplicaLoss::Late);
        }
        let (next, newest) = match &self.writer {
            Some(writer) => (writer.next(), writer.newest()),
            None => participant
                .node()
                .inspect_stream(id)
                .ok()
                .flatten()
                .map_or((0, None), |there| (there.written, there.newest)),
        };
        if record.sequence < next {
            if newest.is_some_and(|newest| is_same(&newest, &record)) {
                self.life = Some(life);
                return self.lose(ReplicaLoss::Duplicate);
            }
            if !self.is_anew(life, record.sequence, next) {
                return self.lose(ReplicaLoss::Late);
            }
        }
        if begun.is_some() {
            let _ = self.lose(ReplicaLoss::Incomplete);
        }
        if record.sequence < next {
            self.writer = None;
        }
        let mut written = self.write(participant, id, record);
        if written.is_err() && !self.is_unopened && self.life != Some(life) {
            // Its time may have begun anew, too: what is there then fits no more.
            self.writer = None;
            let _ = participant.node().remove_orphan_stream(id);
            written = self.write(participant, id, record);
        }
        if let Err(why) = written {
            self.tell(&why);
            return self.lose(ReplicaLoss::Unwritable);
        }
        let parts = record.len_bytes.div_ceil(part_bytes).max(1);
        self.came[..parts.div_ceil(64)].fill(0);
        (self.missing, self.begun_in) = (parts, Some(life));
        true
    }

    /// Begins a record in the ring, which is opened if it is not yet; or why that is not possible.
    fn write(&mut self, participant: &Arc<Participant>, id: StreamId, record: OriginRecord) -> Result<(), String> {
        let mut writer = match self.writer.take() {
            Some(writer) => writer,
            None => {
                let opened = participant.replica_writer(id, self.settings.shape, record.sequence);
                self.is_unopened = opened.is_err();
                opened.map_err(|error| error.to_string())?
            }
        };
        let begun = writer.begin(record);
        self.writer = Some(writer);
        begun.map_err(|error| error.to_string())
    }

    /// Whether a record that is not newer says that its stream was made anew.
    fn is_anew(&self, life: Life, sequence: u64, next: u64) -> bool {
        match self.life {
            Some(newest) => newest.is_before(life) || newest.router != life.router,
            None => {
                let written = self.announced.filter(|(announced, _)| *announced == life).map(|(_, written)| written);
                sequence + 1 == next || written.is_some_and(|written| written < next)
            }
        }
    }

    /// Puts a part into the begun record; whether it is whole now.
    fn put(&mut self, index: usize, offset: usize, bytes: &[u8]) -> bool {
        let (place, bit) = (index / 64, 1 << (index % 64));
        let Some(writer) = &mut self.writer else { return false };
        if self.came[place] & bit != 0 || !writer.put(offset, bytes) {
            return self.lose(ReplicaLoss::Duplicate);
        }
        self.came[place] |= bit;
        self.missing -= 1;
        if self.missing > 0 {
            return false;
        }
        let (next, len) = (writer.next(), writer.open().map_or(0, |record| record.len_bytes));
        let Some(sequence) = writer.finish() else { return false };
        self.counts.gaps.add(sequence.saturating_sub(next));
        self.counts.records.add(1);
        self.counts.bytes.add(len as u64);
        self.life = self.begun_in.take();
        true
    }
}

fn is_same(newest: &RecordInfo, record: &OriginRecord) -> bool {
    let there = (newest.sequence, newest.incarnation, newest.stamp, newest.len_bytes);
    there == (record.sequence, record.incarnation, record.stamp, record.len_bytes)
}
