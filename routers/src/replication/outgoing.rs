//! One stream of this node that others have: how far each of them has come, and what a part of it says.

use super::counts::ReplicaLoss;
use super::description::OwnDescription;
use super::destination::Destination;
use super::fingerprint::Fingerprints;
use super::settings::ReplicaSettings;
use super::{DESCRIBE_EVERY_NS, Describe, LINE_DESCRIBE_EVERY_NS};
use crate::frame::{DESCRIPTION_BYTES_MAX, FrameKind, NodeIndex, PartRequest, RECORD_PART_HEAD_BYTES, RecordPart};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Participant, RecordInfo, StreamId, StreamReader, SystemTime};
use std::sync::Arc;

pub(super) struct OutgoingReplica {
    pub(super) place: u16,
    pub(super) settings: ReplicaSettings,
    /// Of the module that writes it.
    description: OwnDescription,
    describe_every_ns: u64,
    pub(super) reader: Option<StreamReader>,
    /// How often the stream was made anew.
    generation: u16,
    /// There is more to read, and it is not written to its end: its writer died.
    pub(super) is_stalled: bool,
    /// The newest record, when it was looked at last.
    newest: Option<RecordInfo>,
    pub(super) destinations: Vec<Destination>,
    /// Where only changes are sent.
    fingerprints: Option<Fingerprints>,
    /// The destination that is asked first.
    pub(super) turn: usize,
    /// What is wrong with it was told.
    told: bool,
}

impl OutgoingReplica {
    /// For those of `peers` that have it. `by_line`: nothing is lost on the way to them, and records are held here
    /// until they have left.
    pub(super) fn new(
        (place, replica): (u16, &ReplicaSettings),
        peers: impl Iterator<Item = NodeIndex>,
        part_bytes: usize,
        by_line: bool,
    ) -> Self {
        let peers = peers.filter(|peer| replica.to & 1 << peer != 0);
        let parts = (replica.shape.record_bytes as usize).div_ceil(part_bytes);
        Self {
            place,
            describe_every_ns: if by_line { LINE_DESCRIBE_EVERY_NS } else { DESCRIBE_EVERY_NS },
            destinations: peers.map(|peer| Destination::new(place, peer, parts, by_line)).collect(),
            fingerprints: replica.changed.then(Fingerprints::default),
            settings: replica.clone(),
            description: OwnDescription::default(),
            reader: None,
            generation: 0,
            is_stalled: false,
            newest: None,
            turn: 0,
            told: false,
        }
    }

    pub(super) fn look(&mut self, participant: &Arc<Participant>, describe: &Describe) {
        let (from, item) = (self.settings.from, &self.settings.item);
        let Some(words) = participant.node().about(from) else { return };
        if self.reader.is_some() && self.description.is(&words) {
            return;
        }
        let number = describe(&words, item).filter(|_| words.len() <= DESCRIPTION_BYTES_MAX);
        let Some(number) = number else {
            return self.tell(&format!(
                "its description names no such stream, or has more than {DESCRIPTION_BYTES_MAX} bytes"
            ));
        };
        // A seat is free again before the next one is taken.
        self.reader = None;
        match participant.stream_reader(StreamId { name: from, number }) {
            Ok(reader) => self.reader = Some(reader),
            Err(error) => return self.tell(&error.to_string()),
        }
        (self.description, self.told) = (OwnDescription::new(words), false);
        for destination in &mut self.destinations {
            (destination.describe_ns, destination.describing) = (0, None);
            destination.begin_anew();
        }
        self.note_newest();
    }

    fn tell(&mut self, why: &str) {
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!("{} has no replica for now: {why}", self.settings.stream);
        }
    }

    /// Looks for a newer record. One load if there is none.
    pub(super) fn refresh(&mut self) {
        self.is_stalled = false;
        if self.reader.as_ref().is_some_and(StreamReader::has_next) {
            let before = self.newest;
            self.note_newest();
            self.is_stalled = self.newest == before;
        }
    }

    fn note_newest(&mut self) {
        let Some(reader) = &mut self.reader else { return };
        let newest = match reader.newest_info() {
            Ok(newest) => newest,
            Err(error) => {
                // It is opened anew at the next look.
                self.reader = None;
                return self.tell(&error.to_string());
            }
        };
        let Some(newest) = newest else { return };
        reader.seek(newest.sequence + 1);
        let is_older = |before: RecordInfo| newest.sequence <= before.sequence && newest != before;
        if self.newest.is_some_and(is_older) {
            // The stream was made anew.
            self.generation = self.generation.wrapping_add(1);
            for destination in &mut self.destinations {
                destination.next = None;
                destination.begin_anew();
            }
        }
        self.newest = Some(newest);
    }

    /// Takes notice of nodes that have come, were restarted, or are gone. `peers` says in which incarnation a node's
    /// router is (0: none is known), which may have had other records in an earlier one; and whether it is there.
    pub(super) fn meet(&mut self, now_ns: u64, peers: &impl Fn(NodeIndex) -> (u64, bool)) {
        let Self { reader, newest, destinations, .. } = self;
        for destination in destinations {
            let (incarnation, is_there) = peers(destination.peer);
            if std::mem::replace(&mut destination.incarnation, incarnation) != incarnation {
                // It may have nothing: the description and the newest record go to it at once.
                (destination.describe_ns, destination.describing) = (0, None);
                let under_way = destination.under_way.map(|(record, _)| record.sequence);
                destination.begin_anew();
                let again = under_way.or(newest.map(|newest| newest.sequence));
                destination.next = destination.next.zip(again).map(|(next, again)| next.min(again));
                destination.has_none = true;
            }
            if !is_there {
                destination.pass_over(newest.as_ref());
                continue;
            }
            destination.come();
            if now_ns >= destination.describe_ns && destination.describing.is_none() && reader.is_some() {
                destination.describing = Some(0);
            }
        }
        self.let_go();
    }

    /// What was held for a line, and is under way no more.
    fn let_go(&mut self) {
        let is_held = |destination: &Destination| destination.by_line && destination.under_way.is_some();
        if !self.destinations.iter().any(is_held) {
            self.reader.iter_mut().for_each(StreamReader::let_go);
        }
    }

    /// A node asks for parts of a record.
    pub(super) fn ask(&mut self, from: NodeIndex, request: &PartRequest, (incarnation, part_bytes): (u64, usize)) {
        let Self { generation, reader, destinations, .. } = self;
        let Some(destination) = destinations.iter_mut().find(|destination| destination.peer == from) else { return };
        let is_present = (request.router, request.generation) == (incarnation, *generation);
        let asked = match reader.as_mut().filter(|_| is_present) {
            Some(reader) => destination.ask(reader, request, part_bytes),
            None => Err(ReplicaLoss::NotSent),
        };
        if let Err(cause) = asked {
            destination.counts.lost.add(cause, 1);
        }
    }

    /// The first destination with something to send, in turn.
    pub(super) fn choose(&mut self, now_ns: u64, ready: u64) -> Option<usize> {
        let Self { reader, newest, destinations, fingerprints, settings, turn, .. } = self;
        let (reader, count) = (reader.as_mut()?, destinations.len());
        (0..count).map(|step| (*turn + step) % count).find(|at| {
            let destination = &mut destinations[*at];
            let is_ready = ready & 1 << destination.peer != 0 && !destination.is_absent;
            let which = (settings.sampling, fingerprints.as_mut());
            is_ready
                && (destination.describing.is_some()
                    || destination.is_asked()
                    || newest.is_some_and(|newest| destination.begin(now_ns, reader, &newest, which)))
        })
    }

    /// Whether there is something to look at for this destination: what it gets next, or what sampling leaves out.
    pub(super) fn is_behind(&self, to: &Destination) -> bool {
        self.has_more(to, |newest, next| next <= newest)
    }

    /// Whether something waits to leave for it. Of records that are sent only if they changed, any may.
    pub(super) fn waits_for(&self, now_ns: u64, to: &Destination) -> bool {
        self.has_more(to, |newest, next| match self.settings.sampling {
            Sampling::Every(every) if !to.has_none => newest - newest % u64::from(every.max(1)) >= next,
            Sampling::Rate(_) if !to.has_none => next <= newest && now_ns >= to.sample_ns,
            _ => next <= newest,
        })
    }

    fn has_more(&self, to: &Destination, has_next: impl Fn(u64, u64) -> bool) -> bool {
        let has_next = self.newest.is_some_and(|newest| has_next(newest.sequence, to.next.unwrap_or(newest.sequence)));
        let has_some = to.describing.is_some() || to.is_asked() || to.under_way.is_some() || has_next;
        self.reader.is_some() && !to.is_absent && has_some
    }

    /// Writes the next part for a destination behind the datagram's head: its kind and length. None: its record was
    /// overwritten.
    pub(super) fn fill(
        &mut self,
        now_ns: u64,
        system: impl Fn(u64) -> SystemTime,
        (to, part_bytes): (usize, usize),
        content: &mut [u8],
    ) -> Option<(FrameKind, usize)> {
        if let Some(offset) = self.destinations[to].describing {
            return Some((FrameKind::Description, self.describe(now_ns, to, offset, content)));
        }
        let (place, generation, description) = (self.place, self.generation, self.description.check());
        let destination = &mut self.destinations[to];
        let again = destination.next_again();
        let asked = again.map(|part| (part.record, part.index * part_bytes));
        let (info, offset) = asked.or(destination.under_way)?;
        let record = self.reader.as_mut().and_then(|reader| reader.record(info.sequence));
        let Some(record) = record.filter(|record| record.info() == info) else {
            destination.is_overwritten(again.map(|_| info.sequence));
            return None;
        };
        let step = destination.before.filter(|_| again.is_none()).and_then(|before| info.sequence.checked_sub(before));
        let written = system(info.written_ns);
        let is_comparable = written.epoch == info.stamp.epoch;
        let (len, end) = (info.len_bytes, (offset + part_bytes).min(info.len_bytes));
        let part = RecordPart {
            place,
            generation,
            description,
            incarnation: info.incarnation,
            len: len as u32,
            offset: offset as u32,
            sequence: info.sequence,
            epoch: info.stamp.epoch,
            stamp_ns: info.stamp.ns,
            written_ns: if is_comparable { written.ns } else { 0 },
            error_ns: u32::try_from(written.error.as_nanos()).unwrap_or(u32::MAX),
            step: step.and_then(|step| u32::try_from(step).ok()).unwrap_or(0),
            // Nothing is chosen, so nothing left out, while a record is under way.
            sampled: again.map_or(destination.sampled, |part| part.sampled),
            bytes: &record.body()[offset..end],
        };
        let bytes = RECORD_PART_HEAD_BYTES + part.bytes.len();
        content[..RECORD_PART_HEAD_BYTES].copy_from_slice(&part.head_bytes());
        content[RECORD_PART_HEAD_BYTES..bytes].copy_from_slice(part.bytes);
        if again.is_some() {
            destination.sent_again(info.sequence, offset / part_bytes);
            return Some((FrameKind::RecordPart, bytes));
        }
        destination.under_way = (end < len).then_some((info, end));
        if end == len {
            destination.before = Some(info.sequence);
            destination.counts.records.add(1);
            destination.counts.bytes.add(len as u64);
        }
        Some((FrameKind::RecordPart, bytes))
    }

    /// Writes a part of the description; its length.
    fn describe(&mut self, now_ns: u64, to: usize, offset: usize, content: &mut [u8]) -> usize {
        let (place, generation) = (self.place, self.generation);
        let written = self.newest.map_or(0, |newest| newest.sequence + 1);
        let (bytes, end) = self.description.write((place, generation, written), offset, content);
        let destination = &mut self.destinations[to];
        destination.describing = end;
        destination.describe_ns = now_ns + self.describe_every_ns;
        bytes
    }
}
