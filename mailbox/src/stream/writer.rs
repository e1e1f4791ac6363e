//! The writing side of a stream: a record copied in, or filled in place.

use crate::clock::monotonic_ns;
use crate::memory::owned::{self, Refused};
use crate::name::Name;
use crate::node::directory::RegistryLock;
use crate::node::error::{NodeError, REGISTRY_PATIENCE};
use crate::node::lock::Held;
use crate::node::participant::Participant;
use crate::slots::word::Claimant;
use crate::step::step;
use crate::stream::error::{StreamError, WriteError};
use crate::stream::omission::LeftOut;
use crate::stream::place::RecordPlace;
use crate::stream::record::RecordInfo;
use crate::stream::ring::{About, Line, Seat, Stamp};
use crate::stream::segment::StreamSegment;
use crate::stream::shape::{StreamId, StreamShape};
use crate::stream::writing::{Frame, Progress};
use crate::wake::doorbell;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The one writer of a stream. Dropped, the stream stays, and with it its records: the next writer goes on.
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
/// let Next::Record(record) = reader.try_next()? else { panic!("it is there") };
/// assert_eq!((record.body(), record.info().stamp.ns), (&b"a picture"[..], 1_000));
/// // A record is never refused because readers are slow, but it must not be behind.
/// assert!(writer.write(Stamp { epoch: 1, ns: 999 }, b"too late").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StreamWriter {
    participant: Arc<Participant>,
    pub(super) segment: StreamSegment,
    pub(super) progress: Progress,
    /// Tells this writer's records from those of earlier ones.
    pub(super) incarnation: u32,
    late_ns: u64,
    /// The record that was suspended last, until it is taken up or another one is begun; the count that it had.
    suspended: Option<(u64, Frame)>,
    suspensions: u64,
    /// Tells this writer from all others, as long as a record of it is suspended.
    key: Arc<()>,
    /// Where a record is filled in place that may be copied while it is written.
    pub(super) draft: Vec<u8>,
    /// Holds the writer's lock. Below `segment`: fields drop in order, and the lock must outlast the map.
    _lock: Held,
}

impl Participant {
    /// Makes this participant the writer of a stream. What an earlier writer left there goes on if the shape is the
    /// same; else the old stream is given up and replaced, and readers follow. The sequence goes on in both cases.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn stream_writer(self: &Arc<Self>, id: StreamId, shape: StreamShape) -> Result<StreamWriter, StreamError> {
        self.obtain_stream(id, shape, None, REGISTRY_PATIENCE)
    }

    /// The same; a new one may begin with a sequence other than 0.
    pub(super) fn obtain_stream(
        self: &Arc<Self>,
        id: StreamId,
        shape: StreamShape,
        first: Option<u64>,
        patience: Duration,
    ) -> Result<StreamWriter, StreamError> {
        if !id.name.is_mailbox() {
            return Err(StreamError::Reserved(id));
        }
        shape.check().map_err(|error| StreamError::Shape(id, error))?;
        let (node, shape) = (self.node(), shape.as_stored());
        let registry = RegistryLock::take_within(node.directory(), patience).map_err(|error| match error {
            NodeError::Descriptors(_) => StreamError::Descriptors(id),
            error => StreamError::Node(error),
        })?;
        let obtained = owned::obtain::<StreamSegment>(node, id, (shape, first), &registry);
        let (segment, lock) = obtained.map_err(|why| match why {
            Refused::Owned(Ok(there)) => {
                let says = &there.page().writer;
                let module = Name::from_raw(says.module.load(Ordering::Relaxed));
                StreamError::Owned { id, module, pid: says.pid.load(Ordering::Relaxed) }
            }
            // A program of another version, mostly.
            Refused::Owned(Err(why)) => StreamError::Bad(id, why),
            Refused::File(path, source) => StreamError::of(&path, id, shape.segment_bytes(), source),
        })?;
        step!("stream: owned");
        let says = &segment.page().writer;
        says.pid.store(std::process::id(), Ordering::Relaxed);
        says.module.store(self.module().raw(), Ordering::Relaxed);
        says.participant.store(self.claimant().participant.into(), Ordering::Relaxed);
        let progress = Progress::resume(&segment.ring());
        // Readers wait for a stream that is new, and perhaps for records of a writer that died before it woke them.
        node.raise_registry_epoch();
        step!("stream: told");
        doorbell::ring_all(node);
        let draft = vec![0; if shape.is_racing() { shape.record_bytes as usize } else { 0 }];
        let (participant, incarnation, late_ns) = (self.clone(), node.next_incarnation(), shape.late_ns());
        let (suspended, suspensions, key) = (None, 0, Arc::new(()));
        Ok(StreamWriter {
            participant,
            segment,
            progress,
            incarnation,
            late_ns,
            suspended,
            suspensions,
            key,
            draft,
            _lock: lock,
        })
    }
}

impl StreamWriter {
    /// Which stream.
    pub fn id(&self) -> StreamId {
        self.segment.id
    }

    /// What it was made as.
    pub fn shape(&self) -> &StreamShape {
        &self.segment.shape
    }

    /// Sequence of the next record: how many were ever written.
    pub fn written(&self) -> u64 {
        self.progress.next()
    }

    /// Records that were ever refused since their stamps were too far behind.
    pub fn refused(&self) -> u64 {
        self.segment.page().writer.refused.load(Ordering::Relaxed)
    }

    /// Writes a record; its sequence. A number of steps bounded by the number of readers, and no system call unless a
    /// reader sleeps.
    ///
    /// # Errors
    /// See [`WriteError`]. A slow or stopped reader is none.
    pub fn write(&mut self, stamp: Stamp, bytes: &[u8]) -> Result<u64, WriteError> {
        self.check(stamp, bytes.len())?;
        let mut frame = self.claim()?;
        self.segment.fill(&mut frame, bytes);
        Ok(self.publish(frame, stamp, bytes.len()))
    }

    /// A record to be filled in place. Dropped unfinished, nothing happened.
    ///
    /// # Errors
    /// See [`WriteError`].
    pub fn begin(&mut self, stamp: Stamp) -> Result<OpenRecord<'_>, WriteError> {
        self.check(stamp, 0)?;
        let frame = self.claim()?;
        Ok(OpenRecord { open: Some((self, frame)), stamp })
    }

    /// Takes up a record that was suspended; none if it is another writer's, or if another one was begun or written
    /// since, by which it was given up.
    pub fn resume(&mut self, suspended: SuspendedRecord) -> Option<OpenRecord<'_>> {
        let is_its = |(count, _): &(u64, Frame)| *count == suspended.count && Arc::ptr_eq(&self.key, &suspended.key);
        if !self.suspended.as_ref().is_some_and(is_its) {
            return None;
        }
        let (_, frame) = self.suspended.take()?;
        Some(OpenRecord { open: Some((self, frame)), stamp: suspended.stamp })
    }

    /// The record that was written last, by this writer or one before it; none before the first. Only the writer could
    /// put another in its place, and it is borrowed.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Node, Participant, Stamp, StreamId, StreamShape};
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
    /// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    /// let mut writer = participant.stream_writer(id, StreamShape::default())?;
    /// assert!(writer.newest().is_none());
    /// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a picture")?;
    /// assert_eq!(writer.newest().map(|(info, bytes)| (info.sequence, bytes)), Some((0, &b"a picture"[..])));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn newest(&self) -> Option<(RecordInfo, &[u8])> {
        self.segment.ring().newest().map(|line| self.seen(line))
    }

    /// A record that an entry names, as readers see it.
    fn seen(&self, line: Line) -> (RecordInfo, &[u8]) {
        (RecordInfo::of(&self.segment, &line), self.segment.body(&line))
    }

    pub(super) fn check(&self, stamp: Stamp, len: usize) -> Result<(), WriteError> {
        let (id, max, late_ns) = (self.id(), self.segment.shape.record_bytes as usize, self.late_ns);
        if len > max {
            return Err(WriteError::TooLarge { id, len, max });
        }
        if stamp.ns == 0 {
            return Err(WriteError::Unstamped(id));
        }
        let Some(newest) = self.progress.newest() else { return Ok(()) };
        let behind_ns = newest.ns.saturating_sub(stamp.ns);
        let refused = match stamp.epoch.cmp(&newest.epoch) {
            std::cmp::Ordering::Less => WriteError::OldEpoch { id, epoch: stamp.epoch, newest: newest.epoch },
            std::cmp::Ordering::Equal if behind_ns > late_ns => WriteError::Late { id, behind_ns, late_ns },
            _ => return Ok(()),
        };
        self.segment.page().writer.refused.fetch_add(1, Ordering::Relaxed);
        Err(refused)
    }

    pub(super) fn claim(&mut self) -> Result<Frame, WriteError> {
        if let Some((_, frame)) = self.suspended.take() {
            self.progress.give_back(frame);
        }
        self.progress.claim(&self.segment.ring()).ok_or(WriteError::Damaged(self.segment.id))
    }

    pub(super) fn publish(&mut self, frame: Frame, stamp: Stamp, len: usize) -> u64 {
        let about = About {
            stamp,
            before_ns: 0,
            written_ns: monotonic_ns(),
            len_bytes: len as u64,
            incarnation: self.incarnation,
            left_out: LeftOut::default(),
        };
        let participant = &self.participant;
        let wake = |seat: &Seat, sleeper| wake(participant, seat, sleeper);
        let expect = |frame| self.segment.expect(frame);
        self.progress.publish(&self.segment.ring(), frame, about, expect, wake)
    }
}

/// Rings for a sleeping reader; what a dead one said of its sleep is cleared, so that it costs one call.
#[cold]
fn wake(participant: &Participant, seat: &Seat, sleeper: u64) {
    let by = Claimant { participant: (sleeper >> 32) as u16, incarnation: sleeper as u32 };
    let node = participant.node();
    let woken = doorbell::ring(node, by.participant);
    step!("wake: rung");
    if !woken && node.is_dead(by) {
        seat.forget(sleeper);
    }
}

/// A record that is being filled, and does not keep its writer meanwhile. Its place stays with the writer.
#[must_use = "nothing is written unless it is taken up again"]
pub struct SuspendedRecord {
    /// Its writer's.
    key: Arc<()>,
    /// Which of those that its writer suspended.
    count: u64,
    stamp: Stamp,
}

/// A record that is being filled in place; readers do not see it. Dropped, nothing happened.
pub struct OpenRecord<'a> {
    /// None once it is finished.
    open: Option<(&'a mut StreamWriter, Frame)>,
    stamp: Stamp,
}

impl<'a> OpenRecord<'a> {
    /// The bytes to fill, as many as a record may have. What they are at first is not told.
    pub fn body_mut(&mut self) -> &mut [u8] {
        let Some((writer, frame)) = &mut self.open else { return &mut [] };
        if writer.segment.shape.is_racing() { &mut writer.draft } else { writer.segment.body_mut(frame) }
    }

    /// Where the bytes to fill are in the stream's memory; none of a stream with small records, which are filled
    /// elsewhere.
    pub fn at(&self) -> Option<RecordPlace> {
        let (writer, frame) = self.open.as_ref()?;
        let shape = &writer.segment.shape;
        let place = || writer.segment.place_of(frame.number(), shape.record_bytes as usize);
        (!shape.is_racing()).then(place)
    }

    /// Lets go of the writer, to be [taken up](StreamWriter::resume) later: what is in it stays, until another record
    /// is begun or written.
    pub fn suspend(mut self) -> SuspendedRecord {
        // There from `begin` on until here.
        let Some((writer, frame)) = self.open.take() else { unreachable!("it is suspended once") };
        writer.suspensions += 1;
        writer.suspended = Some((writer.suspensions, frame));
        SuspendedRecord { key: writer.key.clone(), count: writer.suspensions, stamp: self.stamp }
    }

    /// Makes the first `len` bytes the next record; its sequence.
    ///
    /// # Errors
    /// [`WriteError::TooLarge`] when a record has not so many.
    pub fn finish(self, len: usize) -> Result<u64, WriteError> {
        self.finish_seen(len).map(|(sequence, _)| sequence)
    }

    /// The same; gives its bytes besides, as readers see them.
    ///
    /// # Errors
    /// As for [`OpenRecord::finish`].
    pub fn finish_seen(mut self, len: usize) -> Result<(u64, &'a [u8]), WriteError> {
        // There from `begin` on until here.
        let Some((writer, mut frame)) = self.open.take() else { unreachable!("it is finished once") };
        let (id, max) = (writer.id(), writer.segment.shape.record_bytes as usize);
        if len > max {
            writer.progress.give_back(frame);
            return Err(WriteError::TooLarge { id, len, max });
        }
        if writer.segment.shape.is_racing() {
            writer.segment.fill(&mut frame, &writer.draft[..len]);
        }
        let sequence = writer.publish(frame, self.stamp, len);
        Ok((sequence, writer.newest().map_or(&[], |(_, bytes)| bytes)))
    }
}

impl Drop for OpenRecord<'_> {
    fn drop(&mut self) {
        if let Some((writer, frame)) = self.open.take() {
            writer.progress.give_back(frame);
        }
    }
}
