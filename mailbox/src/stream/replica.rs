//! The writing side of a replica: records of a stream of another node, with the sequence, incarnation and stamp that
//! they have there, filled part by part as they come.
//!
//! ```text
//! begin ─▶ put, put, … in any order ─▶ finish     left out: readers are told that they lost it
//!   └──────────── give up: nobody saw it
//! ```
//!
//! Several records are begun at a time ([`StreamShape::begun_max`]): older ones of which something is missing, and
//! newer ones that arrive. Small ones are filled in drafts; of others there are two at most, each in a frame of its
//! own. A ring has one frame to spare, so the second is one that no reader holds at present; if readers hold them all,
//! the caller gives up the older.

use crate::name::Name;
use crate::node::about;
use crate::node::error::{NodeError, REGISTRY_PATIENCE};
use crate::node::participant::Participant;
use crate::stream::error::{ReplicaError, StreamError};
use crate::stream::record::RecordInfo;
use crate::stream::ring::{LEFT_OUT, SEQUENCE_MAX, Stamp};
use crate::stream::shape::{StreamId, StreamShape, StreamShapeError};
use crate::stream::writer::StreamWriter;
use crate::stream::writing::Frame;
use std::sync::Arc;
use std::time::Duration;

/// What is said of a record at its origin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OriginRecord {
    /// Its number in the stream.
    pub sequence: u64,
    /// Tells its writer's life from others.
    pub incarnation: u32,
    /// When it was produced.
    pub stamp: Stamp,
    /// Its bytes.
    pub len_bytes: usize,
}

/// The one writer of a replica. Dropped, the stream stays, as with a [`StreamWriter`].
///
/// ```
/// use rohrpost_mailbox::{Missed, Name, Next, Node, OriginRecord, Participant, Stamp, StreamId, StreamShape};
/// # let dir = tempfile::tempdir()?;
/// let node = Node::create(&dir.path().join("node"), 0o700)?;
/// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
/// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
/// let mut replica = participant.replica_writer(id, StreamShape::default(), 7)?;
/// let mut reader = participant.stream_reader(id)?;
/// let record = OriginRecord { sequence: 9, incarnation: 3, stamp: Stamp { epoch: 1, ns: 1_000 }, len_bytes: 9 };
/// replica.begin(record)?;
/// replica.put(9, 2, b"picture");
/// replica.put(9, 0, b"a ");
/// replica.finish(9, 1)?;
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "7 never came");
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "nor did 8");
/// assert_eq!(reader.missed(), Missed { lost: 1, sampled: 1, passed_over: 0 }, "8 was left out on purpose");
/// let Next::Record(read) = reader.try_next()? else { panic!("it is there") };
/// assert_eq!((read.body(), read.info().incarnation), (&b"a picture"[..], 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ReplicaWriter {
    writer: StreamWriter,
    begun: Box<[Option<BegunRecord>]>,
    /// Where records are filled that may be copied while they are written, one for each that is begun.
    drafts: Box<[Vec<u8>]>,
}

struct BegunRecord {
    record: OriginRecord,
    /// None: it is filled in its draft.
    frame: Option<Frame>,
}

impl Participant {
    /// Makes this participant the writer of a replica. What is there goes on if the shape is the same and it ends at or
    /// before the sequence `first`; else the stream is replaced by one that begins with it, and readers follow: then
    /// the origin was made anew.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn replica_writer(
        self: &Arc<Self>,
        id: StreamId,
        shape: StreamShape,
        first: u64,
    ) -> Result<ReplicaWriter, StreamError> {
        self.replica_writer_within(id, shape, first, REGISTRY_PATIENCE)
    }

    /// The same for a thread that others wait for: while another process has the registry, it waits for so long only.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn replica_writer_within(
        self: &Arc<Self>,
        id: StreamId,
        shape: StreamShape,
        first: u64,
        patience: Duration,
    ) -> Result<ReplicaWriter, StreamError> {
        if shape.frames() > LEFT_OUT {
            return Err(StreamError::Shape(id, StreamShapeError::Keep(shape.keep)));
        }
        let writer = self.obtain_stream(id, shape, Some(first.min(SEQUENCE_MAX)), patience)?;
        let places = 0..shape.begun_max();
        let (begun, drafts) = places.map(|_| (None, writer.draft.clone())).unzip::<_, _, Vec<_>, Vec<_>>();
        Ok(ReplicaWriter { writer, begun: begun.into(), drafts: drafts.into() })
    }

    /// Lays the description of a module of another node into this one's directory, as its owner does there
    /// ([`crate::Receiver`]): so its replicas are read here by it.
    ///
    /// # Errors
    /// When the node's directory cannot be changed.
    pub fn describe_replicas(&self, module: Name, words: &[u8]) -> Result<(), NodeError> {
        about::set(self.node(), module, words)
    }
}

impl ReplicaWriter {
    /// Which stream.
    pub fn id(&self) -> StreamId {
        self.writer.id()
    }

    /// The least sequence that the next record may have.
    pub fn next(&self) -> u64 {
        self.writer.written()
    }

    /// The newest record.
    pub fn newest(&self) -> Option<RecordInfo> {
        self.writer.newest().map(|(info, _)| info)
    }

    /// The record of this sequence, if it is begun.
    fn begun(&self, sequence: u64) -> Option<OriginRecord> {
        self.begun.iter().flatten().map(|begun| begun.record).find(|record| record.sequence == sequence)
    }

    /// Begins a record, beside those that are begun already.
    ///
    /// # Errors
    /// See [`ReplicaError`]. Then none is begun, and what was begun before stays so.
    pub fn begin(&mut self, record: OriginRecord) -> Result<(), ReplicaError> {
        let sequence = record.sequence;
        if sequence < self.next() || sequence > SEQUENCE_MAX || self.begun(sequence).is_some() {
            return Err(self.passed(sequence));
        }
        self.writer.check(record.stamp, record.len_bytes)?;
        let is_alone = self.begun.iter().all(Option::is_none);
        let Some(place) = self.begun.iter_mut().find(|place| place.is_none()) else {
            return Err(ReplicaError::Begun(self.writer.id()));
        };
        let frame = match self.writer.shape().is_racing() {
            true => None,
            false if is_alone => Some(self.writer.claim()?),
            false => Some(self.writer.claim().map_err(|_| ReplicaError::Begun(self.writer.id()))?),
        };
        *place = Some(BegunRecord { record, frame });
        Ok(())
    }

    /// Puts bytes into a record that is begun; false when it is not, or they do not lie inside it.
    pub fn put(&mut self, sequence: u64, offset: usize, bytes: &[u8]) -> bool {
        let Some(at) = self.at(sequence) else { return false };
        let Self { writer, begun, drafts } = self;
        let Some(BegunRecord { record, frame }) = &mut begun[at] else { return false };
        let Some(end) = offset.checked_add(bytes.len()).filter(|end| *end <= record.len_bytes) else { return false };
        let body = frame.as_mut().map_or(&mut drafts[at][..], |frame| writer.segment.body_mut(frame));
        body[offset..end].copy_from_slice(bytes);
        true
    }

    /// Makes a record that is begun the newest one; older ones that are begun are given up. Each byte must have been
    /// put: the rest is what an earlier record left there. Of the sequences between the newest before and this one the
    /// last `sampled` were left out on purpose, as far as there are so many; readers are told the others as lost.
    ///
    /// # Errors
    /// See [`ReplicaError`]: it is not begun, or its stamp is too far behind what was finished since. Then it is given
    /// up.
    pub fn finish(&mut self, sequence: u64, sampled: u64) -> Result<(), ReplicaError> {
        let begun = self.at(sequence).and_then(|at| Some((at, self.begun[at].take()?)));
        let Some((at, BegunRecord { record, frame })) = begun else { return Err(self.passed(sequence)) };
        let Self { writer, drafts, .. } = self;
        if let Err(why) = writer.check(record.stamp, record.len_bytes) {
            frame.into_iter().for_each(|frame| writer.progress.give_back(frame));
            return Err(why.into());
        }
        let frame = match frame {
            Some(frame) => frame,
            None => {
                let mut frame = writer.claim()?;
                writer.segment.fill(&mut frame, &drafts[at][..record.len_bytes]);
                frame
            }
        };
        writer.progress.skip_to(&writer.segment.ring(), sequence, sampled);
        writer.incarnation = record.incarnation;
        writer.publish(frame, record.stamp, record.len_bytes);
        for at in 0..self.begun.len() {
            let older = self.begun[at].take_if(|begun| begun.record.sequence < sequence);
            self.give_back(older);
        }
        Ok(())
    }

    /// Gives up a record that is begun.
    pub fn give_up(&mut self, sequence: u64) {
        let begun = self.at(sequence).and_then(|at| self.begun[at].take());
        self.give_back(begun);
    }

    fn give_back(&mut self, begun: Option<BegunRecord>) {
        if let Some(frame) = begun.and_then(|begun| begun.frame) {
            self.writer.progress.give_back(frame);
        }
    }

    fn at(&self, sequence: u64) -> Option<usize> {
        let is_it = |begun: &Option<BegunRecord>| begun.as_ref().is_some_and(|it| it.record.sequence == sequence);
        self.begun.iter().position(is_it)
    }

    fn passed(&self, sequence: u64) -> ReplicaError {
        ReplicaError::Passed { id: self.id(), sequence, next: self.next() }
    }
}

#[cfg(test)]
mod tests;
