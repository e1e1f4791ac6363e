//! The writing side of a replica: records of a stream of another node, with the sequence, incarnation and stamp that
//! they have there, filled part by part as they come.
//!
//! ```text
//! begin ─▶ put, put, … in any order ─▶ finish     left out: readers are told that they lost it
//!   └──────────── begin again: what was begun is given up, nobody saw it
//! ```

use crate::about;
use crate::name::Name;
use crate::node::NodeError;
use crate::participant::Participant;
use crate::stream::error::{ReplicaError, StreamError};
use crate::stream::record::RecordInfo;
use crate::stream::ring::{LEFT_OUT, SEQUENCE_MAX, Stamp};
use crate::stream::shape::{StreamId, StreamShape, StreamShapeError};
use crate::stream::writer::StreamWriter;
use crate::stream::writing::Frame;
use std::sync::Arc;

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
/// use rohrpost_mailbox::{Name, Next, Node, OriginRecord, Participant, Stamp, StreamId, StreamShape};
/// # let dir = tempfile::tempdir()?;
/// let node = Node::create(&dir.path().join("node"), 0o700)?;
/// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
/// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
/// let mut replica = participant.replica_writer(id, StreamShape::default(), 7)?;
/// let mut reader = participant.stream_reader(id)?;
/// let record = OriginRecord { sequence: 9, incarnation: 3, stamp: Stamp { epoch: 1, ns: 1_000 }, len_bytes: 9 };
/// replica.begin(record)?;
/// replica.put(2, b"picture");
/// replica.put(0, b"a ");
/// assert_eq!(replica.finish(), Some(9));
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "7 never came");
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "nor did 8");
/// let Next::Record(read) = reader.try_next()? else { panic!("it is there") };
/// assert_eq!((read.body(), read.info().incarnation), (&b"a picture"[..], 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ReplicaWriter {
    writer: StreamWriter,
    open: Option<(OriginRecord, Frame)>,
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
        if shape.frames() > LEFT_OUT {
            return Err(StreamError::Shape(id, StreamShapeError::Keep(shape.keep)));
        }
        let writer = self.obtain_stream(id, shape, Some(first.min(SEQUENCE_MAX)))?;
        Ok(ReplicaWriter { writer, open: None })
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

    /// The record that is being filled.
    pub fn open(&self) -> Option<OriginRecord> {
        self.open.as_ref().map(|(record, _)| *record)
    }

    /// Begins a record. What was begun and is not finished is given up.
    ///
    /// # Errors
    /// See [`ReplicaError`]. Then none is begun.
    pub fn begin(&mut self, record: OriginRecord) -> Result<(), ReplicaError> {
        let (id, next) = (self.id(), self.next());
        self.give_up();
        if record.sequence < next || record.sequence > SEQUENCE_MAX {
            return Err(ReplicaError::Passed { id, sequence: record.sequence, next });
        }
        self.writer.check(record.stamp, record.len_bytes)?;
        let frame = self.writer.claim()?;
        self.open = Some((record, frame));
        Ok(())
    }

    /// Puts bytes into the record that is begun; false when there is none, or they do not lie inside it.
    pub fn put(&mut self, offset: usize, bytes: &[u8]) -> bool {
        let Self { writer, open } = self;
        let Some((record, frame)) = open else { return false };
        let Some(end) = offset.checked_add(bytes.len()).filter(|end| *end <= record.len_bytes) else { return false };
        let body = if writer.shape().is_racing() { &mut writer.draft[..] } else { writer.segment.body_mut(frame) };
        body[offset..end].copy_from_slice(bytes);
        true
    }

    /// Makes what was begun the newest record; its sequence, or none when none was begun. Each byte must have been put:
    /// the rest is what an earlier record left there.
    pub fn finish(&mut self) -> Option<u64> {
        let (record, mut frame) = self.open.take()?;
        let Self { writer, .. } = self;
        if writer.shape().is_racing() {
            writer.segment.fill(&mut frame, &writer.draft[..record.len_bytes]);
        }
        writer.progress.skip_to(&writer.segment.ring(), record.sequence);
        writer.incarnation = record.incarnation;
        Some(writer.publish(frame, record.stamp, record.len_bytes))
    }

    /// Gives up what was begun.
    pub fn give_up(&mut self) {
        if let Some((_, frame)) = self.open.take() {
            self.writer.progress.give_back(frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Node;
    use crate::stream::error::WriteError;
    use crate::stream::reader::StreamReader;
    use crate::stream::record::{Around, Next};

    const SHAPE: StreamShape = StreamShape { record_bytes: 64, keep: 4, readers: 2, late: std::time::Duration::ZERO };
    const LARGE: StreamShape = StreamShape { record_bytes: 5000, ..SHAPE };

    fn ground() -> (tempfile::TempDir, Arc<Participant>, StreamId) {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let name = Name::new(1, 200, 0, 0);
        let participant = Participant::join(&node, name).unwrap();
        (folder, participant, StreamId { name, number: 1 })
    }

    fn write(replica: &mut ReplicaWriter, sequence: u64) -> Result<(), ReplicaError> {
        let bytes = sequence.to_le_bytes();
        let stamp = Stamp { epoch: 1, ns: 100 + sequence };
        replica.begin(OriginRecord { sequence, incarnation: 7, stamp, len_bytes: bytes.len() })?;
        assert!(replica.put(4, &bytes[4..]) && replica.put(0, &bytes[..4]));
        assert_eq!(replica.finish(), Some(sequence));
        Ok(())
    }

    /// Sequences that are read, and how many are told as lost, until there is nothing.
    fn read(reader: &mut StreamReader) -> (Vec<u64>, u64) {
        let (mut all, mut lost) = (Vec::new(), 0);
        loop {
            match reader.try_next().unwrap() {
                Next::Record(record) => {
                    let sequence = record.info().sequence;
                    assert_eq!(record.body(), sequence.to_le_bytes());
                    assert_eq!((record.info().incarnation, record.info().stamp.ns), (7, 100 + sequence));
                    all.push(sequence);
                }
                Next::Lost(more) => lost += more,
                Next::Nothing => return (all, lost),
            }
        }
    }

    #[test]
    fn each_sequence_is_read_or_told_as_lost() {
        for shape in [SHAPE, LARGE] {
            let (_folder, participant, id) = ground();
            let mut replica = participant.replica_writer(id, shape, 3).unwrap();
            let mut reader = participant.stream_reader(id).unwrap();
            for sequence in [3, 4, 6, 7] {
                write(&mut replica, sequence).unwrap();
            }
            assert_eq!(read(&mut reader), (vec![3 + 1, 6, 7], 2), "3 has lost its place to 7, 5 never came");
            let mut later = participant.stream_reader(id).unwrap();
            assert_eq!((later.position(), read(&mut later)), (8, (vec![], 0)));
            drop(later);
            for sequence in (9..11).chain((30..1000).step_by(97)) {
                write(&mut replica, sequence).unwrap();
                let (all, lost) = read(&mut reader);
                assert_eq!((all, reader.position()), (vec![sequence], sequence + 1));
                assert!(lost > 0 || sequence == 10);
            }
            let (read, lost) = reader.accounts();
            assert_eq!((read, read + lost), (3 + 2 + 10, 904 - 3));
            assert!(matches!(write(&mut replica, 32), Err(ReplicaError::Passed { next: 904, .. })));
        }
    }

    #[test]
    fn a_held_record_stays_whole_when_many_are_left_out() {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, LARGE, 0).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        write(&mut replica, 0).unwrap();
        let Next::Record(held) = reader.try_next().unwrap() else { panic!("it is there") };
        for sequence in (10..200).step_by(7) {
            write(&mut replica, sequence).unwrap();
            assert_eq!(held.body(), 0_u64.to_le_bytes());
        }
    }

    #[test]
    fn times_are_found_beside_what_was_left_out() {
        let (_folder, participant, id) = ground();
        let shape = StreamShape { keep: 64, ..SHAPE };
        let mut replica = participant.replica_writer(id, shape, 0).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        let written: Vec<u64> =
            (0..40_u64).filter(|sequence| sequence % 7 != 3 && !(20..31).contains(sequence)).collect();
        for sequence in &written {
            write(&mut replica, *sequence).unwrap();
            for asked in 0..=*sequence {
                let around = reader.around(Stamp { epoch: 1, ns: 100 + asked }).unwrap();
                let before = written.iter().rfind(|there| **there <= asked);
                let after = written.iter().find(|there| **there >= asked);
                let Around::Records { before: found, after: next } = around else { panic!("{asked}: {around:?}") };
                assert_eq!((Some(&found.sequence), Some(&next.sequence)), (before, after), "of {asked}");
            }
        }
        assert_eq!(
            participant.node().inspect_stream(id).unwrap().unwrap().oldest.map(|oldest| oldest.sequence),
            Some(0)
        );
    }

    #[test]
    fn the_next_writer_goes_on_and_an_origin_made_anew_begins_anew() {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, SHAPE, 0).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        write(&mut replica, 0).unwrap();
        write(&mut replica, 5).unwrap();
        drop(replica);
        let mut replica = participant.replica_writer(id, SHAPE, 6).unwrap();
        assert_eq!((replica.next(), replica.newest().map(|info| info.sequence)), (6, Some(5)));
        write(&mut replica, 6).unwrap();
        assert_eq!(read(&mut reader).0.last(), Some(&6));
        drop(replica);
        let mut replica = participant.replica_writer(id, SHAPE, 2).unwrap();
        assert_eq!((replica.next(), replica.newest()), (2, None));
        write(&mut replica, 2).unwrap();
        assert_eq!(read(&mut reader), (vec![2], 0));
    }

    #[test]
    fn what_does_not_fit_is_not_written() {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, SHAPE, 0).unwrap();
        let stamp = Stamp { epoch: 1, ns: 1 };
        let record = OriginRecord { sequence: 0, incarnation: 1, stamp, len_bytes: 65 };
        assert!(matches!(replica.begin(record), Err(ReplicaError::Write(WriteError::TooLarge { .. }))));
        assert!(!replica.put(0, b"a") && replica.finish().is_none());
        replica.begin(OriginRecord { len_bytes: 8, ..record }).unwrap();
        for (offset, bytes) in [(8, &b"a"[..]), (1, b"12345678"), (usize::MAX, b"ab")] {
            assert!(!replica.put(offset, bytes), "{offset}");
        }
        replica.give_up();
        assert!(replica.open().is_none());
        let unstamped = OriginRecord { stamp: Stamp { epoch: 1, ns: 0 }, len_bytes: 8, ..record };
        assert!(matches!(replica.begin(unstamped), Err(ReplicaError::Write(WriteError::Unstamped(_)))));
        let past = OriginRecord { sequence: SEQUENCE_MAX + 1, len_bytes: 8, ..record };
        assert!(matches!(replica.begin(past), Err(ReplicaError::Passed { .. })));
    }
}
