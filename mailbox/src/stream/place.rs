//! A record's bytes as an address, for programs in other languages that hand out views of them.

use crate::memory::mapping::Mapping;
use std::ptr::NonNull;

/// Where a record's bytes are. The memory stays mapped as long as this does, whatever becomes of the reader or the
/// writer: an address that was handed out leads to bytes, be they those of a later record by then.
///
/// ```
/// use rohrpost_mailbox::{Name, Node, Participant, Stamp, StreamId, StreamShape};
/// # let dir = tempfile::tempdir()?;
/// let node = Node::create(&dir.path().join("node"), 0o700)?;
/// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
/// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
/// let mut writer = participant.stream_writer(id, StreamShape::default())?;
/// let mut reader = participant.stream_reader(id)?;
/// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a picture")?;
/// let place = reader.newest()?.ok_or("it is there")?.stay();
/// assert_eq!(place.len(), 9); // held until `reader` takes another record
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct RecordPlace {
    first: NonNull<u8>,
    len: usize,
    _mapping: Mapping,
}

// SAFETY: an address and a mapping that belongs to no thread; nothing is reached through it here.
unsafe impl Send for RecordPlace {}
// SAFETY: as above.
unsafe impl Sync for RecordPlace {}

impl RecordPlace {
    /// `len` bytes at `first`, which lies in the mapping.
    pub(super) fn new(first: NonNull<u8>, len: usize, mapping: &Mapping) -> Self {
        Self { first, len, _mapping: mapping.clone() }
    }

    /// Their address. What a reader has may not be written.
    pub fn address(&self) -> NonNull<u8> {
        self.first
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

#[cfg(test)]
mod tests {
    use super::RecordPlace;
    use crate::name::Name;
    use crate::node::directory::Node;
    use crate::node::participant::Participant;
    use crate::stream::ring::Stamp;
    use crate::stream::shape::{StreamId, StreamShape};
    use crate::stream::writer::StreamWriter;
    use std::sync::Arc;
    use std::time::Duration;

    const BYTES: usize = 10_000;

    fn participant(folder: &tempfile::TempDir) -> Arc<Participant> {
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        Participant::join(&node, Name::new(1, 200, 0, 0)).unwrap()
    }

    fn writer(participant: &Arc<Participant>) -> (StreamId, StreamWriter) {
        let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
        let shape = StreamShape { record_bytes: BYTES as u32, keep: 2, readers: 1, late: Duration::ZERO };
        (id, participant.stream_writer(id, shape).unwrap())
    }

    fn stamp(number: u8) -> Stamp {
        Stamp { epoch: 1, ns: 1 + u64::from(number) }
    }

    fn bytes(place: &RecordPlace) -> Vec<u8> {
        // SAFETY: so many bytes of a mapping that `place` keeps; no other thread writes them in these tests.
        unsafe { std::slice::from_raw_parts(place.address().as_ptr(), place.len()) }.to_vec()
    }

    #[test]
    fn what_stays_is_whole_until_its_reader_takes_another_and_mapped_for_longer() {
        let folder = tempfile::tempdir().unwrap();
        let participant = participant(&folder);
        let (id, mut writer) = writer(&participant);
        let mut reader = participant.stream_reader(id).unwrap();
        writer.write(stamp(0), &[0; BYTES]).unwrap();
        let place = reader.newest().unwrap().unwrap().stay();
        for number in 1..20 {
            writer.write(stamp(number), &[number; BYTES]).unwrap();
            assert_eq!(bytes(&place), [0; BYTES], "{number}");
        }
        drop(reader.newest().unwrap());
        for number in 20..40 {
            writer.write(stamp(number), &[number; BYTES]).unwrap();
        }
        drop((reader, writer));
        let there = bytes(&place);
        assert!(there.iter().all(|byte| *byte == there[0]), "it is mapped, whatever record has the place");
    }

    #[test]
    fn a_record_that_was_suspended_is_filled_by_its_place_and_finished_or_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let participant = participant(&folder);
        let (_, mut writer) = writer(&participant);
        for number in 0..20 {
            let open = writer.begin(stamp(number)).unwrap();
            let place = open.at().unwrap();
            let suspended = open.suspend();
            assert_eq!((place.len(), writer.written()), (BYTES, u64::from(number)), "nothing is there yet");
            // SAFETY: the record is being filled, so its bytes are this thread's alone.
            unsafe { place.address().as_ptr().write_bytes(number, 7) };
            let given_up = writer.resume(suspended).unwrap();
            drop(given_up);
            let again = writer.begin(stamp(number)).unwrap().suspend();
            let mut open = writer.resume(again).unwrap();
            open.body_mut()[..7].fill(number);
            let (sequence, seen) = open.finish_seen(7).unwrap();
            assert_eq!((sequence, seen), (u64::from(number), &[number; 7][..]));
        }
    }

    #[test]
    fn a_record_is_taken_up_by_its_writer_alone_and_only_if_no_other_was_begun_since() {
        let folder = tempfile::tempdir().unwrap();
        let participant = participant(&folder);
        let (id, mut writer) = writer(&participant);
        let shape = StreamShape { record_bytes: BYTES as u32, keep: 200, readers: 1, late: Duration::ZERO };
        let mut other = participant.stream_writer(StreamId { number: 2, ..id }, shape).unwrap();
        // Frames of the greater ring, which the smaller one does not have.
        for number in 0..50 {
            other.write(stamp(number), &[number; BYTES]).unwrap();
        }
        let strange = other.begin(stamp(50)).unwrap().suspend();
        let own = writer.begin(stamp(0)).unwrap().suspend();
        assert!(writer.resume(strange).is_none());
        assert!(writer.resume(own).is_some());
        let mut reader = participant.stream_reader(id).unwrap();
        for number in 1..20 {
            let given_up = writer.begin(stamp(number)).unwrap().suspend();
            let sequence = writer.write(stamp(number), &[number; BYTES]).unwrap();
            let held = reader.newest().unwrap().unwrap();
            assert!(writer.resume(given_up).is_none(), "its frame is a record's by now, which a reader has in hand");
            assert_eq!((held.info().sequence, held.body()), (sequence, &[number; BYTES][..]));
            // Dropped, it costs no place.
            let _ = writer.begin(stamp(number)).unwrap().suspend();
        }
    }
}
