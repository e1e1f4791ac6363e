//! A record that a reader keeps in hand for longer than a look: one that leaves by a slow line, part by part.
//!
//! The seat names its frame all the while, so the writer goes round it as round any record that is held. It costs the
//! stream the frame that is there for this reader.

use super::StreamReader;
use crate::stream::error::StreamError;
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
