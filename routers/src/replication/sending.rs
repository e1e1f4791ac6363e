//! The sending half: which part of which record leaves next.
//!
//! Each node that has a replica has a place of its own in the stream, so one without room in its socket delays no
//! other. A place that is behind by more than half of the ring goes on with the newest record: older ones would be
//! overwritten on their way. What such a node asks for again goes before what is new to it. Requests of this node for
//! parts of others leave here as well, each at the level of its stream, and before parts of that level.

use super::counts::{ReplicaLoss, SentReplica};
use super::description::OwnDescription;
use super::destination::Destination;
use super::requests::{OwnRequests, PartRequests};
use super::settings::ReplicaSettings;
use super::{DESCRIBE_EVERY_NS, Describe, part_bytes};
use crate::frame::{
    self, DESCRIPTION_BYTES_MAX, FrameKind, NodeIndex, PartRequest, RECORD_PART_HEAD_BYTES, RecordPart,
};
use crate::outbound::Outbound;
use crate::settings::Settings;
use rohrpost_mailbox::{Participant, RecordInfo, StreamId, StreamReader, SystemTime};
use std::sync::Arc;

/// Next step for the code around the core.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReplicaStep {
    /// Send the first bytes of the buffer as one datagram, then ask again.
    Send {
        /// Receiver.
        to: NodeIndex,
        /// Length.
        bytes: usize,
    },
    /// Something waits for the wire, at the most until then, ns of the monotonic clock.
    Wait {
        /// Until when.
        until_ns: u64,
    },
    /// Nothing before this time, unless a record is written.
    Idle {
        /// Until when.
        until_ns: u64,
    },
}

/// The sending half of all replicas of a node's streams. One thread has it.
pub struct ReplicaSender {
    part_bytes: usize,
    /// Incarnation of this router.
    incarnation: u64,
    own_requests: OwnRequests,
    /// The nodes that such requests go to, one bit each.
    origins: u64,
    /// The most important first.
    streams: Vec<OutgoingReplica>,
    /// Among those of one level, the first to be asked.
    turn: usize,
}

struct OutgoingReplica {
    place: u16,
    settings: ReplicaSettings,
    /// Of the module that writes it.
    description: OwnDescription,
    reader: Option<StreamReader>,
    /// How often the stream was made anew.
    generation: u16,
    /// The newest record, when it was looked at last.
    newest: Option<RecordInfo>,
    destinations: Vec<Destination>,
    /// The destination that is asked first.
    turn: usize,
    /// What is wrong with it was told.
    told: bool,
}

impl ReplicaSender {
    /// Of all `replicas` those that are written on this node.
    pub fn new(settings: &Settings, replicas: &[ReplicaSettings]) -> Self {
        let own = (0..).zip(replicas).filter(|(_, replica)| replica.node == settings.own);
        let mut streams: Vec<_> = own.map(|(place, replica)| OutgoingReplica::new(place, replica, settings)).collect();
        streams.sort_by_key(|stream| stream.settings.level);
        let here = replicas.iter().filter(|replica| replica.to & 1 << settings.own != 0);
        let origins = here.fold(0, |all, replica| all | 1 << replica.node) & !(1 << settings.own);
        let own_requests = OwnRequests::new(PartRequests::new(settings, replicas));
        let (part_bytes, incarnation) = (part_bytes(settings), settings.incarnation);
        Self { part_bytes, incarnation, own_requests, origins, streams, turn: 0 }
    }

    /// Whether no stream of this node has a replica, and this one has none.
    pub fn is_empty(&self) -> bool {
        self.streams.is_empty() && self.origins == 0
    }

    /// The queues between this half and [`ReplicaReceiver::asking_by`](super::ReplicaReceiver::asking_by).
    pub fn requests(&self) -> &Arc<PartRequests> {
        self.own_requests.queues()
    }

    /// The nodes that something goes to, one bit each.
    pub(crate) fn peers(&self) -> u64 {
        let all = self.streams.iter().flat_map(|stream| &stream.destinations);
        all.fold(self.origins, |peers, destination| peers | 1 << destination.peer)
    }

    /// Counters of each replica and node.
    pub fn counts(&self) -> Vec<Arc<SentReplica>> {
        let all = self.streams.iter().flat_map(|stream| &stream.destinations);
        all.map(|destination| destination.counts.clone()).collect()
    }

    /// Looks which modules have begun, and what they say of their streams. A few system calls: call it now and then.
    pub fn look(&mut self, participant: &Arc<Participant>, describe: &dyn Describe) {
        self.streams.iter_mut().for_each(|stream| stream.look(participant, describe));
    }

    /// The streams that are read, to sleep until there is a record.
    pub fn readers(&mut self) -> Vec<&mut StreamReader> {
        self.streams.iter_mut().filter_map(|stream| stream.reader.as_mut()).collect()
    }

    /// The next datagram, or when to ask again. `datagram` has room for the largest; `system` tells system time at a
    /// moment of the monotonic clock.
    ///
    /// # Panics
    /// If it has not.
    pub fn poll(
        &mut self,
        now_ns: u64,
        system: impl Fn(u64) -> SystemTime,
        outbound: &mut Outbound,
        datagram: &mut [u8],
    ) -> ReplicaStep {
        for stream in &mut self.streams {
            stream.refresh();
            stream.meet(now_ns, outbound);
        }
        for (from, request) in self.own_requests.queues().take_all() {
            let stream = self.streams.iter_mut().find(|stream| stream.place == request.place);
            stream.into_iter().for_each(|stream| stream.ask(from, &request, (self.incarnation, self.part_bytes)));
        }
        loop {
            let ready = outbound.ready_peers();
            let chosen = self.choose(now_ns, ready);
            let level = chosen.map(|(at, _)| self.streams[at].settings.level);
            match self.own_requests.next(now_ns, level, outbound, datagram) {
                Some(Ok((to, bytes))) => return ReplicaStep::Send { to, bytes },
                Some(Err(until_ns)) => return ReplicaStep::Wait { until_ns },
                None => {}
            }
            let Some((at, to)) = chosen else { return self.wait(now_ns) };
            let stream = &mut self.streams[at];
            let level = stream.settings.level;
            if let Err(until_ns) = outbound.may_leave(now_ns, level) {
                return ReplicaStep::Wait { until_ns };
            }
            // A record that was overwritten meanwhile is gone: another one is chosen.
            let content = &mut datagram[frame::HEAD_BYTES..];
            let filled = stream.fill(now_ns, &system, (to, self.part_bytes), content);
            let Some((kind, bytes)) = filled else { continue };
            if stream.destinations[to].under_way.is_none() && !stream.destinations[to].is_asked() {
                self.turn = at + 1;
            }
            stream.turn = to + 1;
            let to = stream.destinations[to].peer;
            return ReplicaStep::Send { to, bytes: outbound.carry(now_ns, (kind, level), to, (datagram, bytes)) };
        }
    }

    /// A stream and one of its destinations that have something for a ready peer: of the most important level, and
    /// there in turn.
    fn choose(&mut self, now_ns: u64, ready: u64) -> Option<(usize, usize)> {
        let (mut begin, turn) = (0, self.turn);
        for level in self.streams.chunk_by_mut(|a, b| a.settings.level == b.settings.level) {
            let count = level.len();
            let first = turn.checked_sub(begin).filter(|first| *first < count).unwrap_or(0);
            for at in (0..count).map(|step| (first + step) % count) {
                if let Some(to) = level[at].choose(now_ns, ready) {
                    return Some((begin + at, to));
                }
            }
            begin += count;
        }
        None
    }

    fn wait(&self, now_ns: u64) -> ReplicaStep {
        let all = || self.streams.iter().flat_map(|stream| stream.destinations.iter().map(move |to| (stream, to)));
        if all().any(|(stream, to)| stream.waits_for(to)) {
            // For room in a socket: that is known elsewhere.
            return ReplicaStep::Wait { until_ns: u64::MAX };
        }
        // What is due and not under way is for a node that is not there.
        let due = all().map(|(_, to)| to.describe_ns).filter(|at_ns| *at_ns > now_ns);
        ReplicaStep::Idle { until_ns: due.min().unwrap_or(u64::MAX) }
    }
}

impl OutgoingReplica {
    fn new(place: u16, replica: &ReplicaSettings, settings: &Settings) -> Self {
        let peers = settings.peers().filter(|peer| replica.to & 1 << peer != 0);
        let parts = (replica.shape.record_bytes as usize).div_ceil(part_bytes(settings));
        Self {
            place,
            destinations: peers.map(|peer| Destination::new(place, peer, parts)).collect(),
            settings: replica.clone(),
            description: OwnDescription::default(),
            reader: None,
            generation: 0,
            newest: None,
            turn: 0,
            told: false,
        }
    }

    fn look(&mut self, participant: &Arc<Participant>, describe: &dyn Describe) {
        let (from, item) = (self.settings.from, &self.settings.item);
        let Some(words) = participant.node().about(from) else { return };
        if self.reader.is_some() && self.description.is(&words) {
            return;
        }
        let number = describe.number(&words, item).filter(|_| words.len() <= DESCRIPTION_BYTES_MAX);
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
            (destination.describe_ns, destination.describing, destination.under_way) = (0, None, None);
        }
        self.note_newest();
    }

    fn tell(&mut self, why: &str) {
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!("stream {} of {} has no replica for now: {why}", self.settings.item, self.settings.from);
        }
    }

    /// Looks for a newer record. One load if there is none.
    fn refresh(&mut self) {
        if self.reader.as_ref().is_some_and(StreamReader::has_next) {
            self.note_newest();
        }
    }

    fn note_newest(&mut self) {
        let Some(reader) = &mut self.reader else { return };
        let newest = reader.newest().map(|newest| newest.map(|record| record.info()));
        let newest = match newest {
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

    /// Takes notice of nodes that have come, were restarted, or are gone.
    fn meet(&mut self, now_ns: u64, outbound: &Outbound) {
        let Self { reader, newest, destinations, .. } = self;
        for destination in destinations {
            let incarnation = outbound.incarnation_of(destination.peer);
            if std::mem::replace(&mut destination.incarnation, incarnation) != incarnation {
                // It may have nothing: the description and the newest record go to it at once.
                (destination.describe_ns, destination.describing) = (0, None);
                let under_way = destination.under_way.map(|(record, _)| record.sequence);
                destination.begin_anew();
                let again = under_way.or(newest.map(|newest| newest.sequence));
                destination.next = destination.next.zip(again).map(|(next, again)| next.min(again));
            }
            if !outbound.is_there(now_ns, destination.peer) {
                destination.pass_over(newest.as_ref());
            } else if now_ns >= destination.describe_ns && destination.describing.is_none() && reader.is_some() {
                destination.describing = Some(0);
            }
        }
    }

    /// A node asks for parts of a record.
    fn ask(&mut self, from: NodeIndex, request: &PartRequest, (incarnation, part_bytes): (u64, usize)) {
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
    fn choose(&mut self, now_ns: u64, ready: u64) -> Option<usize> {
        let Self { reader, newest, destinations, settings, turn, .. } = self;
        let (reader, count) = (reader.as_mut()?, destinations.len());
        (0..count).map(|step| (*turn + step) % count).find(|at| {
            let destination = &mut destinations[*at];
            let is_ready = ready & 1 << destination.peer != 0;
            is_ready
                && (destination.describing.is_some()
                    || destination.is_asked()
                    || newest.is_some_and(|newest| destination.begin(now_ns, reader, &newest, settings.sampling)))
        })
    }

    /// Whether something waits for this destination.
    fn waits_for(&self, to: &Destination) -> bool {
        let is_behind = self.newest.zip(to.next).is_some_and(|(newest, next)| next <= newest.sequence);
        self.reader.is_some() && (to.describing.is_some() || to.is_asked() || to.under_way.is_some() || is_behind)
    }

    /// Writes the next part for a destination behind the datagram's head: its kind and length. None: its record was
    /// overwritten.
    fn fill(
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
        let (info, offset) = again.map(|(info, index)| (info, index * part_bytes)).or(destination.under_way)?;
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
        destination.describe_ns = now_ns + DESCRIBE_EVERY_NS;
        bytes
    }
}
