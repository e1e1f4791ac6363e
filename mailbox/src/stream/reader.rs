//! The reading side of a stream: records copied out, or read in place.

mod kept;

use crate::node::participant::Participant;
use crate::stream::error::StreamError;
use crate::stream::lookup::{self, Answer};
use crate::stream::missed::{Missed, MissedAccount};
use crate::stream::record::{Around, HeldRecord, Next, RecordInfo, TakenSeat};
use crate::stream::ring::{Line, Look, Ring, SEQUENCE_MAX, Stamp, TRIES};
use crate::stream::shape::{StreamId, StreamShape};
use crate::wake::waiting::{self, Waiting, steps::Steps};
use std::sync::Arc;

/// One of a stream's readers, with a position of its own. It may be there before its stream is.
pub struct StreamReader {
    participant: Arc<Participant>,
    id: StreamId,
    place: Option<TakenSeat>,
    /// The registry's when this looked for the stream.
    registry_epoch: Option<u32>,
    /// Sequence of the next record to read.
    next: u64,
    read: u64,
    lost: u64,
    missed: MissedAccount,
    eager: bool,
    /// The record that stays held: the seat names its frame.
    kept: Option<Line>,
}

impl Participant {
    /// Opens a stream to read, from what is written next on; from its first record, when there is no such stream yet.
    /// Takes one of its seats.
    ///
    /// # Errors
    /// [`StreamError::Crowded`] when all seats are taken, or what stands in the way of its file.
    pub fn stream_reader(self: &Arc<Self>, id: StreamId) -> Result<StreamReader, StreamError> {
        let participant = self.clone();
        let (next, read, lost, missed) = (0, 0, 0, MissedAccount::default());
        let (place, registry_epoch, eager, kept) = (None, None, false, None);
        let mut reader = StreamReader { participant, id, place, registry_epoch, next, read, lost, missed, eager, kept };
        reader.follow()?;
        reader.go_to(reader.ring().map_or(0, |ring| ring.written()));
        Ok(reader)
    }
}

impl StreamReader {
    /// Which stream.
    pub fn id(&self) -> StreamId {
        self.id
    }

    /// What the stream was made as; none while there is none.
    pub fn shape(&self) -> Option<&StreamShape> {
        self.place.as_ref().map(|place| &place.segment.shape)
    }

    /// The participant that its bell wakes.
    pub fn participant(&self) -> &Arc<Participant> {
        &self.participant
    }

    /// Sequence of the next record to read.
    pub fn position(&self) -> u64 {
        self.next
    }

    /// Goes on from this sequence, at most 2^56: no stream comes to more. What is there no more counts as lost.
    pub fn seek(&mut self, sequence: u64) {
        self.go_to(sequence.min(SEQUENCE_MAX));
    }

    /// Passes over all that was written until now; it counts neither as read nor as lost.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Next, Node, Participant, Stamp, StreamId, StreamShape};
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
    /// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    /// let mut writer = participant.stream_writer(id, StreamShape::default())?;
    /// let mut reader = participant.stream_reader(id)?;
    /// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a picture")?;
    /// reader.pass_over()?;
    /// assert!(matches!(reader.try_next()?, Next::Nothing));
    /// assert_eq!(reader.accounts(), (0, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn pass_over(&mut self) -> Result<(), StreamError> {
        self.leave_retired()?;
        if let Some(ring) = self.ring() {
            self.go_to(self.next.max(ring.written()));
        }
        Ok(())
    }

    /// Records read one after the other, and records lost on the way. Both are what was written since it began, less
    /// what it has not come to yet.
    pub fn accounts(&self) -> (u64, u64) {
        (self.read, self.lost)
    }

    /// The lost ones of [`StreamReader::accounts`] by cause, in records. What [`Next::Lost`] has told is among them,
    /// except while the writer goes on so fast that no record behind it could be looked at: then it is from the next
    /// one on.
    ///
    /// ```
    /// use rohrpost_mailbox::{Missed, Name, Next, Node, Participant, Stamp, StreamId, StreamShape};
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
    /// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    /// let mut writer = participant.stream_writer(id, StreamShape { keep: 4, ..StreamShape::default() })?;
    /// let mut reader = participant.stream_reader(id)?;
    /// for ns in 1..10 {
    ///     writer.write(Stamp { epoch: 1, ns }, b"a picture")?;
    /// }
    /// let before = reader.missed();
    /// assert!(matches!(reader.try_next()?, Next::Lost(5)), "the ring keeps 4");
    /// assert_eq!(reader.missed().since(&before), Missed { lost: 0, sampled: 0, passed_over: 5 });
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn missed(&self) -> Missed {
        self.missed.missed()
    }

    /// Whether there is something to read, or to be told.
    pub fn has_next(&self) -> bool {
        self.may_have()
    }

    /// The next record, to read in place; it is held until it is dropped.
    ///
    /// # Errors
    /// When the stream was replaced or made, and cannot be opened. What was read before stays read.
    pub fn try_next(&mut self) -> Result<Next<HeldRecord<'_>>, StreamError> {
        self.let_go();
        let next = self.advance(|place, line| place.ring().hold(place.seat, line))?;
        Ok(self.held(next))
    }

    /// The next record, copied into `body`, which is cleared first. A body with room for a record takes no memory.
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn try_next_into(&mut self, body: &mut Vec<u8>) -> Result<Next<RecordInfo>, StreamError> {
        self.let_go();
        let next = self.advance(|place, line| place.segment.copy(place.seat, line, body))?;
        Ok(self.told(next))
    }

    /// As [`StreamReader::try_next`]; waits, at most for a timeout ([`Duration`](std::time::Duration)) or as a
    /// [`Waiting`] says.
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn next_timeout(&mut self, waiting: impl Into<Waiting>) -> Result<Next<HeldRecord<'_>>, StreamError> {
        self.let_go();
        let next = self.await_next(waiting.into(), |place, line| place.ring().hold(place.seat, line))?;
        Ok(self.held(next))
    }

    /// As [`StreamReader::try_next_into`]; waits as [`StreamReader::next_timeout`] does.
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn next_timeout_into(
        &mut self,
        body: &mut Vec<u8>,
        waiting: impl Into<Waiting>,
    ) -> Result<Next<RecordInfo>, StreamError> {
        self.let_go();
        let next = self.await_next(waiting.into(), |place, line| place.segment.copy(place.seat, line, body))?;
        Ok(self.told(next))
    }

    /// The newest record, to read in place; none before the first, and none if the writer turns the whole ring during
    /// each of some looks. The position stays.
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn newest(&mut self) -> Result<Option<HeldRecord<'_>>, StreamError> {
        self.let_go();
        let line = self.take_newest(|place, line| place.ring().hold(place.seat, line))?;
        Ok(line.and_then(|line| self.hand_out(line)))
    }

    /// The newest record, copied into `body`, which is cleared first; none as for [`StreamReader::newest`].
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn newest_into(&mut self, body: &mut Vec<u8>) -> Result<Option<RecordInfo>, StreamError> {
        self.let_go();
        let line = self.take_newest(|place, line| place.segment.copy(place.seat, line, body))?;
        Ok(line.and_then(|line| Some(self.place.as_ref()?.info(&line))))
    }

    /// What [`StreamReader::record`] hands out, copied into `body`, which is cleared first.
    pub fn record_into(&mut self, sequence: u64, body: &mut Vec<u8>) -> Option<RecordInfo> {
        self.let_go();
        let place = self.place.as_ref()?;
        let Look::There(line) = place.ring().look(sequence) else { return None };
        place.segment.copy(place.seat, &line, body).then(|| place.info(&line))
    }

    /// The two records around a time. [`StreamReader::record`] reads each.
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn around(&mut self, at: Stamp) -> Result<Around, StreamError> {
        self.leave_retired()?;
        let Some(place) = &self.place else { return Ok(Around::Empty) };
        Ok(match lookup::around(&place.ring(), at, place.segment.shape.late_ns()) {
            Answer::Around { before, after } => {
                Around::Records { before: place.info(&before), after: place.info(&after) }
            }
            Answer::Empty => Around::Empty,
            Answer::BeforeOldest { by_ns } => Around::BeforeOldest { by_ns },
            Answer::NotYet { by_ns } => Around::NotYet { by_ns },
            Answer::OtherEpoch { newest } => Around::OtherEpoch { newest },
        })
    }

    fn ring(&self) -> Option<Ring<'_>> {
        self.place.as_ref().map(TakenSeat::ring)
    }

    /// Takes the next record by `take`, which fails when it was overwritten.
    fn advance(&mut self, mut take: impl FnMut(&TakenSeat, &Line) -> bool) -> Result<Next<Line>, StreamError> {
        // Once more if it was replaced: then the first record of the new one may be there.
        for _ in 0..2 {
            let Some(place) = &self.place else {
                if self.follow()? {
                    continue;
                }
                break;
            };
            let ring = place.ring();
            match ring.look(self.next) {
                Look::There(line) if take(place, &line) => {
                    self.next += 1;
                    self.read += 1;
                    self.missed.come_to(line.about.left_out);
                    return Ok(Next::Record(line));
                }
                Look::There(_) | Look::Gone => {
                    let oldest = self.missed.miss(&ring, place.seat, self.next);
                    let lost = oldest - self.next;
                    self.next = oldest;
                    // Only damaged files and many jumps back come to so many.
                    self.lost = self.lost.saturating_add(lost);
                    return Ok(Next::Lost(lost));
                }
                Look::NotYet => {}
            }
            if !self.follow()? {
                break;
            }
        }
        Ok(Next::Nothing)
    }

    fn await_next(
        &mut self,
        waiting: Waiting,
        mut take: impl FnMut(&TakenSeat, &Line) -> bool,
    ) -> Result<Next<Line>, StreamError> {
        loop {
            match self.advance(&mut take)? {
                Next::Nothing if !waiting.is_over() => {
                    waiting::wait(&mut [&mut *self], None, waiting, || false, |sleep| sleep());
                }
                next => return Ok(next),
            }
        }
    }

    fn take_newest(&mut self, mut take: impl FnMut(&TakenSeat, &Line) -> bool) -> Result<Option<Line>, StreamError> {
        self.leave_retired()?;
        let Some(place) = &self.place else { return Ok(None) };
        Ok((0..TRIES).find_map(|_| place.ring().newest().filter(|line| take(place, line))))
    }

    /// A record that is held since just now.
    fn hand_out(&self, line: Line) -> Option<HeldRecord<'_>> {
        self.place.as_ref().map(|place| HeldRecord { place, line, is_kept: false })
    }

    fn held(&self, next: Next<Line>) -> Next<HeldRecord<'_>> {
        match (next, &self.place) {
            (Next::Record(line), Some(place)) => Next::Record(HeldRecord { place, line, is_kept: false }),
            (Next::Lost(lost), _) => Next::Lost(lost),
            _ => Next::Nothing,
        }
    }

    fn told(&self, next: Next<Line>) -> Next<RecordInfo> {
        self.held(next).map(|record| record.place.info(&record.line))
    }

    /// Goes to the stream that has the name now, when there is none here, or it was given up and all of it was read;
    /// whether it went.
    fn follow(&mut self) -> Result<bool, StreamError> {
        // In this order: all records are seen once it is seen given up.
        let is_done =
            self.place.as_ref().is_none_or(|place| place.segment.is_retired() && !place.ring().is_due(self.next));
        if is_done { self.enter() } else { Ok(false) }
    }

    /// The same for a look that does not go by the position.
    fn leave_retired(&mut self) -> Result<(), StreamError> {
        if self.place.as_ref().is_none_or(|place| place.segment.is_retired()) {
            self.enter()?;
        }
        Ok(())
    }

    #[cold]
    fn enter(&mut self) -> Result<bool, StreamError> {
        // Read before it is looked for: what comes in between makes this number an old one.
        let registry_epoch = Some(self.participant.node().registry_epoch());
        if registry_epoch == self.registry_epoch {
            return Ok(false);
        }
        let place = TakenSeat::take(&self.participant, self.id, self.place.as_ref())?;
        self.registry_epoch = registry_epoch;
        let Some(place) = place else { return Ok(false) };
        // It was removed and made anew: what replaces a stream goes on with its sequence.
        let is_anew = self.place.as_ref().is_some_and(|old| place.ring().first() < old.ring().written());
        let is_first = self.place.is_none() && self.next == 0 && place.segment.is_replica();
        let next = if is_anew || is_first { place.ring().first() } else { self.next };
        // The seat that held it is left.
        (self.place, self.kept) = (Some(place), None);
        self.go_to(next);
        Ok(true)
    }

    /// Goes on from this sequence.
    fn go_to(&mut self, sequence: u64) {
        self.next = sequence;
        if let Some(place) = &self.place {
            self.missed.begin(&place.ring(), sequence);
        }
    }
}

impl Steps for StreamReader {
    fn participant(&self) -> &Arc<Participant> {
        &self.participant
    }

    fn settle(&mut self) {
        // If it fails, it may have something: the next read says what.
        let _ = self.follow();
    }

    fn may_have(&self) -> bool {
        let looked = || self.registry_epoch == Some(self.participant.node().registry_epoch());
        match &self.place {
            Some(place) => place.ring().is_due(self.next) || place.segment.is_retired() && !looked(),
            None => !looked(),
        }
    }

    fn expect(&self) {}

    fn drowsy(&self) {
        if let Some(place) = &self.place {
            let me = self.participant.claimant();
            place.ring().drowsy(place.seat, u64::from(me.participant) << 32 | u64::from(me.incarnation));
        }
    }

    fn awake(&self) {
        if let Some(place) = &self.place {
            place.ring().awake(place.seat);
        }
    }

    fn is_eager(&self) -> bool {
        self.eager
    }

    fn set_eager(&mut self, eager: bool) {
        self.eager = eager;
    }
}
