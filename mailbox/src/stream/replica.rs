//! The writing side of a replica: records of a stream of another node, with the sequence, incarnation and stamp that
//! they have there, filled part by part as they come.
//!
//! ```text
//! begin ─▶ put, put, … in any order ─▶ finish     left out: readers are told that they lost it
//!   └──────────── give up: nobody saw it
//! ```
//!
//! Two records are begun at a time at most: an older one of which something is missing, and a newer one that arrives.
//! Each is filled in a frame of its own. A ring has one frame to spare, so the second is one that no reader holds at
//! present; if readers hold them all, the caller gives up the older.

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

/// Records that are begun at a time, at most.
const BEGUN_MAX: usize = 2;

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
/// replica.put(9, 2, b"picture");
/// replica.put(9, 0, b"a ");
/// replica.finish(9)?;
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "7 never came");
/// assert!(matches!(reader.try_next()?, Next::Lost(1)), "nor did 8");
/// let Next::Record(read) = reader.try_next()? else { panic!("it is there") };
/// assert_eq!((read.body(), read.info().incarnation), (&b"a picture"[..], 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ReplicaWriter {
    writer: StreamWriter,
    begun: [Option<BegunRecord>; BEGUN_MAX],
    /// Where records are filled that may be copied while they are written, one for each that is begun.
    drafts: [Vec<u8>; BEGUN_MAX],
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
        if shape.frames() > LEFT_OUT {
            return Err(StreamError::Shape(id, StreamShapeError::Keep(shape.keep)));
        }
        let writer = self.obtain_stream(id, shape, Some(first.min(SEQUENCE_MAX)))?;
        let drafts = [writer.draft.clone(), writer.draft.clone()];
        Ok(ReplicaWriter { writer, begun: [None, None], drafts })
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
    pub fn begun(&self, sequence: u64) -> Option<OriginRecord> {
        self.begun.iter().flatten().map(|begun| begun.record).find(|record| record.sequence == sequence)
    }

    /// Begins a record, beside one that may be begun already.
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

    /// Makes a record that is begun the newest one; an older one that is begun is given up. Each byte must have been
    /// put: the rest is what an earlier record left there.
    ///
    /// # Errors
    /// See [`ReplicaError`]: it is not begun, or its stamp is too far behind what was finished since. Then it is given
    /// up.
    pub fn finish(&mut self, sequence: u64) -> Result<(), ReplicaError> {
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
        writer.progress.skip_to(&writer.segment.ring(), sequence);
        writer.incarnation = record.incarnation;
        writer.publish(frame, record.stamp, record.len_bytes);
        let older = self.begun.iter().flatten().map(|begun| begun.record.sequence).find(|older| *older < sequence);
        older.into_iter().for_each(|older| self.give_up(older));
        Ok(())
    }

    /// Gives up a record that is begun.
    pub fn give_up(&mut self, sequence: u64) {
        let begun = self.at(sequence).and_then(|at| self.begun[at].take());
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
        assert!(replica.put(sequence, 4, &bytes[4..]) && replica.put(sequence, 0, &bytes[..4]));
        replica.finish(sequence)
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

    fn begin(replica: &mut ReplicaWriter, sequence: u64, ns: u64) -> Result<(), ReplicaError> {
        replica.begin(OriginRecord { sequence, incarnation: 7, stamp: Stamp { epoch: 1, ns }, len_bytes: 8 })
    }

    #[test]
    fn two_records_are_filled_at_once_and_finished_in_order() {
        for shape in [SHAPE, LARGE] {
            let (_folder, participant, id) = ground();
            let mut replica = participant.replica_writer(id, shape, 0).unwrap();
            let mut reader = participant.stream_reader(id).unwrap();
            for older in (0..60).step_by(3) {
                let newer = older + 1;
                for sequence in [older, newer] {
                    begin(&mut replica, sequence, 100 + sequence).unwrap();
                }
                assert!(matches!(begin(&mut replica, newer + 1, 900), Err(ReplicaError::Begun(_))), "a third");
                for half in [0, 4] {
                    for sequence in [newer, older] {
                        assert!(replica.put(sequence, half, &sequence.to_le_bytes()[half..half + 4]));
                    }
                }
                assert!(matches!(reader.try_next().unwrap(), Next::Nothing), "nobody sees what is not finished");
                if older % 2 == 0 {
                    replica.finish(older).unwrap();
                }
                replica.finish(newer).unwrap();
                assert!(
                    replica.begun(older).is_none() && replica.finish(older).is_err(),
                    "a sequence does not go back"
                );
                let (all, lost) = read(&mut reader);
                let before = u64::from(older > 0);
                let expected = if older % 2 == 0 { (vec![older, newer], before) } else { (vec![newer], before + 1) };
                assert_eq!((all, lost), expected);
            }
        }
    }

    #[test]
    fn a_stamp_behind_what_was_finished_meanwhile_is_refused() {
        for shape in [SHAPE, LARGE] {
            let (_folder, participant, id) = ground();
            let mut replica = participant.replica_writer(id, shape, 0).unwrap();
            begin(&mut replica, 0, 100).unwrap();
            begin(&mut replica, 1, 99).unwrap();
            replica.finish(0).unwrap();
            assert!(matches!(replica.finish(1), Err(ReplicaError::Write(WriteError::Late { .. }))));
            assert_eq!((replica.next(), replica.begun(1)), (1, None));
        }
    }

    #[test]
    fn a_frame_that_no_reader_holds_is_there_for_one_record_always() {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, LARGE, 0).unwrap();
        let mut readers = [participant.stream_reader(id).unwrap(), participant.stream_reader(id).unwrap()];
        write(&mut replica, 0).unwrap();
        write(&mut replica, 1).unwrap();
        let [one, two] = &mut readers;
        let _ = two.try_next().unwrap();
        let held = [one, two].map(|reader| reader.try_next().unwrap());
        (2..9).for_each(|sequence| write(&mut replica, sequence).unwrap());
        begin(&mut replica, 9, 109).unwrap();
        assert!(matches!(begin(&mut replica, 10, 110), Err(ReplicaError::Begun(_))), "readers hold all others");
        replica.give_up(9);
        begin(&mut replica, 10, 110).unwrap();
        drop(held);
        begin(&mut replica, 11, 111).unwrap();
        for sequence in [10, 11_u64] {
            assert!(replica.put(sequence, 0, &sequence.to_le_bytes()));
            replica.finish(sequence).unwrap();
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
        assert!(!replica.put(0, 0, b"a") && replica.finish(0).is_err());
        replica.begin(OriginRecord { len_bytes: 8, ..record }).unwrap();
        for (offset, bytes) in [(8, &b"a"[..]), (1, b"12345678"), (usize::MAX, b"ab")] {
            assert!(!replica.put(0, offset, bytes), "{offset}");
        }
        assert!(!replica.put(1, 0, b"a"), "another record");
        assert!(matches!(replica.begin(OriginRecord { len_bytes: 8, ..record }), Err(ReplicaError::Passed { .. })));
        replica.give_up(0);
        assert!(replica.begun(0).is_none());
        let unstamped = OriginRecord { stamp: Stamp { epoch: 1, ns: 0 }, len_bytes: 8, ..record };
        assert!(matches!(replica.begin(unstamped), Err(ReplicaError::Write(WriteError::Unstamped(_)))));
        let past = OriginRecord { sequence: SEQUENCE_MAX + 1, len_bytes: 8, ..record };
        assert!(matches!(replica.begin(past), Err(ReplicaError::Passed { .. })));
    }
}
