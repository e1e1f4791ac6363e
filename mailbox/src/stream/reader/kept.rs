//! A record that a reader keeps in hand for longer than a look: one that leaves by a slow line, part by part.
//!
//! The seat names its frame all the while, so the writer goes round it as round any record that is held. It costs the
//! stream the frame that is there for this reader.

use super::StreamReader;
use crate::stream::error::StreamError;
use crate::stream::missed::Missed;
use crate::stream::omission::LeftOut;
use crate::stream::record::{HeldRecord, RecordInfo};
use crate::stream::ring::Look;

impl StreamReader {
    /// What is said of the newest record; none as for [`StreamReader::newest`]. The position stays, and so does what is
    /// [kept](StreamReader::keep).
    ///
    /// # Errors
    /// As for [`StreamReader::try_next`].
    pub fn newest_info(&mut self) -> Result<Option<RecordInfo>, StreamError> {
        let line = self.take_newest(|_, _| true)?;
        Ok(line.and_then(|line| Some(self.place.as_ref()?.info(&line))))
    }

    /// Holds the record of this sequence until this reader takes another one, or [lets it go](StreamReader::let_go):
    /// [`StreamReader::record`] hands it out as often as it is asked, also when newer ones have its place in the ring.
    /// None when it is there no more, or not yet; then nothing is kept.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Node, Participant, Stamp, StreamId, StreamShape};
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
    /// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    /// let mut writer = participant.stream_writer(id, StreamShape { keep: 2, ..StreamShape::default() })?;
    /// let mut reader = participant.stream_reader(id)?;
    /// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a large picture")?;
    /// assert_eq!(reader.keep(0).map(|info| info.len_bytes), Some(15));
    /// for ns in 1_001..1_010 {
    ///     writer.write(Stamp { epoch: 1, ns }, b"newer")?;
    /// }
    /// assert_eq!(reader.record(0).map(|record| record.body().to_vec()), Some(b"a large picture".to_vec()));
    /// reader.let_go();
    /// assert!(reader.record(0).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn keep(&mut self, sequence: u64) -> Option<RecordInfo> {
        self.let_go();
        let place = self.place.as_ref()?;
        let Look::There(line) = place.ring().look(sequence) else { return None };
        self.kept = Some(line).filter(|line| place.ring().hold(place.seat, line));
        self.kept.map(|line| place.info(&line))
    }

    /// Keeps nothing any more.
    pub fn let_go(&mut self) {
        if let Some((place, _)) = self.place.as_ref().zip(self.kept.take()) {
            place.ring().release(place.seat);
        }
    }

    /// What the ring has left out before this record since it began, lost or sampled out; none when it is there no
    /// more, or not yet. Only rings of replicas leave out some.
    pub fn left_out_before(&self, sequence: u64) -> Option<Missed> {
        let LeftOut { lost, sampled } = self.place.as_ref()?.ring().left_out_before(sequence)?;
        Some(Missed { lost, sampled, passed_over: 0 })
    }

    /// The record of this sequence, to read in place; none when it is there no more, or not yet. The position stays.
    pub fn record(&mut self, sequence: u64) -> Option<HeldRecord<'_>> {
        if let Some(line) = self.kept.filter(|line| line.sequence == sequence) {
            return self.place.as_ref().map(|place| HeldRecord { place, line, is_kept: true });
        }
        self.let_go();
        let place = self.place.as_ref()?;
        let Look::There(line) = place.ring().look(sequence) else { return None };
        if place.ring().hold(place.seat, &line) { self.hand_out(line) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use crate::name::Name;
    use crate::node::directory::Node;
    use crate::node::participant::Participant;
    use crate::stream::record::Next;
    use crate::stream::ring::Stamp;
    use crate::stream::shape::{StreamId, StreamShape};
    use std::time::Duration;

    /// Records of both kinds of memory: of words, and of plain bytes.
    #[test]
    fn what_is_kept_is_whole_however_often_the_ring_turns_until_another_is_taken() {
        for record_bytes in [64, 10_000] {
            let folder = tempfile::tempdir().unwrap();
            let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
            let participant = Participant::join(&node, Name::new(1, 200, 0, 0)).unwrap();
            let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
            let shape = StreamShape { record_bytes, keep: 2, readers: 1, late: Duration::ZERO };
            let mut writer = participant.stream_writer(id, shape).unwrap();
            let mut reader = participant.stream_reader(id).unwrap();
            let body = |number: u64| vec![number as u8; record_bytes as usize];
            let mut write = |number: u64| writer.write(Stamp { epoch: 1, ns: 1 + number }, &body(number)).unwrap();
            write(0);
            let kept = reader.keep(0).unwrap();
            for number in 1..20 {
                write(number);
                let newest = reader.newest_info().unwrap().unwrap();
                assert_eq!((newest.sequence, newest.len_bytes), (number, record_bytes as usize));
                let record = reader.record(0).unwrap();
                assert_eq!((record.info(), record.body()), (kept, &body(0)[..]), "{number}");
            }
            assert!(reader.keep(5).is_none() && reader.record(0).is_none(), "nothing is kept then");
            assert!(reader.keep(19).is_some());
            assert!(matches!(reader.try_next().unwrap(), Next::Lost(_)), "reading on lets it go");
            write(20);
            write(21);
            assert!(reader.record(19).is_none());
        }
    }
}
