//! One replica of this node: its ring, and the records that may be open at a time, oldest first.
//!
//! ```text
//!  part ─▶ of an open record? ─┬─ yes ──────────────▶ put ─▶ whole: published, when nothing older is open
//!                              ├─ newer than all ───▶ opened; what is missing of those before is asked for; if there
//!                              │                      is no room, the oldest is given up: incomplete
//!                              └─ between, before ──▶ opened in its place, or late, duplicate; or made anew
//! ```
//!
//! A newer record that is whole waits for older ones as long as an answer takes: a pose is late by one round trip when
//! the one before it was lost or reordered, and never by more. A record of which no part came is known by the next one,
//! which says how far behind it is: so what the sender left out on purpose is never asked for.

mod due;
mod ending;
mod open;

use super::alarms::DelayAlarm;
use super::answer_time::{AnswerTime, Unanswered};
use super::counts::{ReceivedReplica, ReplicaLoss};
use super::description::{DescriptionAssembly, KnownOrigin};
use super::gathering::{Arriving, Life};
use super::requests::OutgoingRequest;
use super::settings::ReplicaSettings;
use crate::frame::RecordPart;
use open::OpenRecords;
use rohrpost_mailbox::{
    OriginRecord, Participant, RecordInfo, ReplicaError, ReplicaWriter, STREAM_SEQUENCE_MAX, StreamId, SystemTime,
    Throttle,
};
use rtrb::Producer;
use std::sync::Arc;
use std::time::Duration;

/// A ring that cannot be opened or made is tried again after this, ns. By a line the next one is not opened, and no
/// other description taken, before that either: the thread that does it has other ends as well, and files are slow.
const RETRY_NS: u64 = 1_000_000_000;
/// How long that thread waits for a process of this node that has the registry, at most. Others have more time.
const LINE_PATIENCE: Duration = Duration::from_millis(5);
const PATIENCE: Duration = Duration::from_secs(2);

/// Where and when a part is taken.
#[derive(Clone, Copy)]
pub(super) struct Now<'a> {
    pub(super) ns: u64,
    pub(super) participant: &'a Arc<Participant>,
    /// System time now.
    pub(super) system: &'a dyn Fn() -> SystemTime,
}

pub(super) struct IncomingReplica {
    place: u16,
    pub(super) settings: ReplicaSettings,
    part_bytes: usize,
    pub(super) counts: Arc<ReceivedReplica>,
    pub(super) assembly: DescriptionAssembly,
    pub(super) known: Option<KnownOrigin>,
    /// What the description that came last says: of which life, and how many records were written.
    pub(super) announced: Option<(Life, u64)>,
    writer: Option<ReplicaWriter>,
    /// Of the newest record; none: it was written before this router began.
    life: Option<Life>,
    /// What its sender had sampled out before it, in that life, modulo 2^32; none: not known.
    sampled: Option<u32>,
    open: OpenRecords,
    /// The newest record that was given up: what still comes of it, or of older ones, is late.
    given_up: Option<(Life, u64)>,
    answer_time: AnswerTime,
    /// What was asked for of a record that was given up since: a part of it may still come.
    unanswered: Option<Unanswered>,
    /// The ring could not be opened or made, and is not tried again before, ns.
    retry_ns: u64,
    /// By a line: no other ring is opened before, and no other description taken before, ns.
    open_ns: u64,
    describe_ns: u64,
    /// It comes by a session, of which the thread has others as well.
    by_line: bool,
    /// None: nothing is asked for.
    requests: Option<Producer<OutgoingRequest>>,
    /// A request waits to be sent.
    pub(super) has_asked: bool,
    /// What is wrong with it was told.
    told: bool,
    delays: DelayAlarm,
    /// When missing records were told.
    missing_told: Throttle,
}

impl IncomingReplica {
    pub(super) fn new(place: u16, replica: &ReplicaSettings, part_bytes: usize, by_line: bool) -> Self {
        Self {
            place,
            settings: replica.clone(),
            part_bytes,
            counts: Arc::new(ReceivedReplica::new(place)),
            assembly: DescriptionAssembly::default(),
            known: None,
            announced: None,
            writer: None,
            life: None,
            sampled: None,
            open: OpenRecords::new(replica, part_bytes),
            given_up: None,
            answer_time: AnswerTime::default(),
            unanswered: None,
            retry_ns: 0,
            open_ns: 0,
            describe_ns: 0,
            by_line,
            requests: None,
            has_asked: false,
            told: false,
            delays: DelayAlarm::default(),
            missing_told: Throttle::default(),
        }
    }

    /// How long a process of this node that has the registry is waited for.
    pub(super) fn patience(&self) -> Duration {
        if self.by_line { LINE_PATIENCE } else { PATIENCE }
    }

    /// Whether another description may be taken now; then none is for a while.
    pub(super) fn may_describe(&mut self, now_ns: u64) -> bool {
        let may = !self.by_line || now_ns >= self.describe_ns;
        if may {
            self.describe_ns = now_ns.saturating_add(RETRY_NS);
        }
        may
    }

    /// From now on missing parts are asked for, unless the configuration says never.
    pub(super) fn ask_by(&mut self, requests: Producer<OutgoingRequest>) {
        self.requests = Some(requests).filter(|_| self.settings.deadline_ns > 0);
    }

    pub(super) fn tell(&mut self, why: &str) {
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!("the replica of {} is not written for now: {why}", self.settings.stream);
        }
    }

    /// Counts a part or record that is not taken.
    pub(super) fn lose(&self, cause: ReplicaLoss) {
        self.counts.lost.add(cause, 1);
    }

    /// The stream is described, anew or for the first time.
    pub(super) fn is_described(&mut self, known: KnownOrigin) {
        self.forget();
        (self.known, self.told) = (Some(known), false);
    }

    /// Its ring is left as it is, and opened again when a record comes.
    pub(super) fn forget(&mut self) {
        self.cut();
        (self.writer, self.known) = (None, None);
    }

    /// What is open is given up.
    pub(super) fn cut(&mut self) {
        while !self.open.is_empty() {
            self.give_up_oldest();
        }
    }

    /// Takes a part.
    pub(super) fn take(&mut self, now: Now<'_>, life: Life, part: &RecordPart<'_>) {
        let Some(known) = self.known.filter(|known| known.check == part.description) else {
            return self.lose(ReplicaLoss::Undescribed);
        };
        if part.len > self.settings.shape.record_bytes {
            return self.lose(ReplicaLoss::TooLarge);
        }
        let offset = part.offset as usize;
        let whole = self.part_bytes.min((part.len as usize).saturating_sub(offset));
        if !offset.is_multiple_of(self.part_bytes)
            || part.bytes.len() != whole
            || part.stamp_ns == 0
            || part.sequence > STREAM_SEQUENCE_MAX
        {
            return self.lose(ReplicaLoss::Unsound);
        }
        if now.ns < self.retry_ns {
            return self.lose(ReplicaLoss::Unwritable);
        }
        if self.is_over(life) {
            return self.lose(ReplicaLoss::Late);
        }
        let arriving = Arriving::of(part);
        let is_of = |open: &OpenRecords| open.iter().position(|open| open.is_of(&arriving.record, life));
        if is_of(&self.open).is_none() {
            self.begin(now, known.id, life, (arriving, part.step));
        }
        if let Some(at) = is_of(&self.open) {
            self.put(now, at, offset, part.bytes);
        }
        self.ask_if_due(now.ns);
    }

    /// Whether the stream was made anew since, as its router has said.
    pub(super) fn is_over(&self, life: Life) -> bool {
        let announced = self.announced.map(|(life, _)| life);
        let open = self.open.iter().map(|open| open.life);
        open.chain(announced).chain(self.life).any(|known| life.is_before(known))
    }

    /// Opens a record, if it may still be published. `step`: see [`RecordPart::step`].
    fn begin(&mut self, now: Now<'_>, id: StreamId, life: Life, (arriving, step): (Arriving, u32)) {
        let record = arriving.record;
        let newest_open = self.open.last().map(|open| (open.life, open.sequence));
        let is_behind = newest_open.is_some_and(|(of, newest)| of == life && record.sequence <= newest);
        let (next, newest) = self.there(now, id);
        if record.sequence < next {
            if newest.is_some_and(|newest| arriving.is(&newest)) {
                (self.life, self.sampled) = (Some(life), Some(arriving.sampled));
                return self.lose(ReplicaLoss::Duplicate);
            }
            if is_behind || !self.is_anew(life, record.sequence, next) {
                return self.late(now.ns, life, record.sequence);
            }
        }
        if is_behind {
            return self.begin_older(now, id, life, (arriving, step));
        }
        if newest_open.is_some_and(|(of, _)| of != life) {
            // What is open is of a time that has ended. By then the ring may be further.
            self.settle(now);
            return self.begin(now, id, life, (arriving, step));
        }
        self.make_room(now);
        if record.sequence < next {
            self.close_ring();
        }
        if let Err(why) = self.write_anew(now, id, life, record) {
            if self.writer.is_none() {
                self.retry_ns = now.ns + RETRY_NS;
            }
            // The older ones are behind nothing now.
            self.settle(now);
            return self.refuse(why);
        }
        self.open.insert(record.sequence).open_seen(now.ns, arriving, life, self.part_bytes);
        self.expect_before(now.ns, life, record, step);
    }

    /// What the ring has: the number of its next record, and its newest one.
    fn there(&self, now: Now<'_>, id: StreamId) -> (u64, Option<RecordInfo>) {
        if let Some(writer) = &self.writer {
            return (writer.next(), writer.newest());
        }
        let there = now.participant.node().inspect_stream(id).ok().flatten();
        there.map_or((0, None), |there| (there.written, there.newest))
    }

    /// Begins the record in the ring. If that does not fit, in a ring made anew where the origin's may be, too.
    fn write_anew(
        &mut self,
        now: Now<'_>,
        id: StreamId,
        life: Life,
        record: OriginRecord,
    ) -> Result<(), Option<String>> {
        let written = self.write(now, id, record);
        if !matches!(written, Err(Some(_))) || self.writer.is_none() || self.life == Some(life) {
            return written;
        }
        // Its time may have begun anew, too: what is there then fits no more.
        self.close_ring();
        if let Err(error) = now.participant.node().remove_orphan_stream(id) {
            self.tell(&format!("its ring of an earlier time cannot be removed: {error}"));
        }
        self.write(now, id, record)
    }

    /// The record that was sent before this one is waited for, if nothing of it has come.
    fn expect_before(&mut self, now_ns: u64, life: Life, record: OriginRecord, step: u32) {
        let Some(before) = record.sequence.checked_sub(step.into()).filter(|_| step > 0) else { return };
        let is_lost = self.writer.as_ref().is_some_and(|writer| before >= writer.next());
        let is_known = self.open.iter().any(|open| open.sequence == before) || self.is_given_up(life, before);
        if is_lost && !is_known && self.requests.is_some() && self.open.has_room() {
            self.open.insert(before).open_unseen(now_ns, before, life);
        }
    }

    /// Whether this record, or a newer one, was given up.
    fn is_given_up(&self, life: Life, sequence: u64) -> bool {
        self.given_up.is_some_and(|(of, newest)| of == life && sequence <= newest)
    }

    /// Opens a record that is behind one that is open: it was asked for, or has come by a longer way.
    fn begin_older(&mut self, now: Now<'_>, id: StreamId, life: Life, (arriving, step): (Arriving, u32)) {
        let record = arriving.record;
        let unseen = self.open.iter().position(|open| open.is_unseen(record.sequence, life));
        let is_new = unseen.is_none();
        let is_other = is_new && self.open.iter().any(|open| open.sequence == record.sequence);
        let has_place = !is_new || (self.open.has_room() && !self.is_given_up(life, record.sequence));
        if is_other || !has_place || self.requests.is_none() {
            return self.late(now.ns, life, record.sequence);
        }
        if let Err(why) = self.write(now, id, record) {
            if why.is_none() {
                // Readers hold all frames but one, so no answer can be taken: nothing waits for one.
                self.end_through(now, record.sequence);
            }
            return self.refuse(why);
        }
        // To write it, what is older may have been given up.
        let unseen = self.open.iter_mut().find(|open| open.is_unseen(record.sequence, life));
        let open = match unseen {
            Some(open) => open,
            None => self.open.insert(record.sequence),
        };
        open.open_seen(now.ns, arriving, life, self.part_bytes);
        if is_new {
            open.is_passed();
        }
        self.expect_before(now.ns, life, record, step);
    }

    /// The ring is opened anew for the next record; frames of open ones are its frames.
    fn close_ring(&mut self) {
        self.cut();
        self.writer = None;
    }

    /// A record was not begun; why, if not for lack of room.
    fn refuse(&mut self, why: Option<String>) {
        self.lose(if why.is_some() { ReplicaLoss::Unwritable } else { ReplicaLoss::Late });
        why.into_iter().for_each(|why| self.tell(&why));
    }

    /// Begins a record in the ring, which is opened if it is not yet; or why that is not possible, with no writer if it
    /// is not open. Without room beside older ones these are given up; none: there is no room for an older one.
    fn write(&mut self, now: Now<'_>, id: StreamId, record: OriginRecord) -> Result<(), Option<String>> {
        loop {
            let writer = self.opened(now, id, record)?;
            let why = match writer.begin(record) {
                Ok(()) => return Ok(()),
                Err(ReplicaError::Begun(_)) => None,
                Err(why) => return Err(Some(why.to_string())),
            };
            if self.open.first().is_none_or(|oldest| oldest.sequence >= record.sequence) {
                return Err(why);
            }
            self.give_up_oldest();
            self.publish_before(now, record.sequence);
        }
    }

    /// The writer of the ring.
    fn opened(&mut self, now: Now<'_>, id: StreamId, record: OriginRecord) -> Result<&mut ReplicaWriter, String> {
        let writer = match self.writer.take() {
            Some(writer) => writer,
            None if self.by_line && now.ns < self.open_ns => {
                return Err("its stream was made anew more than once a second".into());
            }
            None => {
                self.open_ns = now.ns.saturating_add(RETRY_NS);
                let (shape, first) = (self.settings.shape, record.sequence);
                let opened = now.participant.replica_writer_within(id, shape, first, self.patience());
                opened.map_err(|error| error.to_string())?
            }
        };
        Ok(self.writer.insert(writer))
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

    /// Puts a part into an open record, and publishes what is whole by it.
    fn put(&mut self, now: Now<'_>, at: usize, offset: usize, bytes: &[u8]) {
        let (open, index) = (&mut self.open[at], offset / self.part_bytes);
        let Some(writer) = &mut self.writer else { return };
        if open.has(index) || !writer.put(open.sequence, offset, bytes) {
            return self.lose(ReplicaLoss::Duplicate);
        }
        if let Some((took_ns, requests)) = open.note(now.ns, index) {
            self.answer_time.answered(took_ns, requests);
        }
        self.publish_whole(now);
    }
}
