//! A thread that reads a file ahead: its messages are there before they are asked for.
//!
//! Unpacking a chunk takes milliseconds, and a disk may take longer. A replay, which plays messages at their times, has
//! none to spare. What waits is bounded, so memory stays the same however long the file is.

use crate::error::{ReadError, Shown};
use crate::read::contents::{Contents, Ending, Found, Item};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};

/// So much is handed over at once, unless one message is longer, and so often ahead: some chunks of ours in all, more
/// than a burst of pictures and clouds fills.
pub(crate) const BATCH_BYTES: usize = 2 << 20;
const BATCHES_AHEAD: usize = 2;

/// Messages that follow each other.
#[derive(Default)]
pub(crate) struct MessageBatch {
    data: Vec<u8>,
    /// What is wrong with the file, too, where it is.
    pub(crate) found: VecDeque<Result<Found, ReadError>>,
    /// So many bytes of the file are read.
    pub(crate) read_bytes: u64,
    /// The file is read to its end, and was closed there.
    pub(crate) is_closed: bool,
}

impl MessageBatch {
    /// Errors are told at once. Messages need not have data, and take memory all the same.
    pub(crate) fn is_full(&self) -> bool {
        let has_failed = matches!(self.found.back(), Some(Err(_)));
        has_failed || self.data.len() + self.found.len() * size_of::<Found>() >= BATCH_BYTES
    }

    pub(crate) fn push(&mut self, found: &Found, data: &[u8]) {
        self.found.push_back(Ok(found.copied(data, &mut self.data)));
    }

    pub(crate) fn fail(&mut self, error: ReadError) {
        self.found.push_back(Err(error));
    }
}

/// Messages of a file, read by a thread. It ends with this.
pub(crate) struct ReadAhead {
    batches: Receiver<MessageBatch>,
    batch: MessageBatch,
}

impl ReadAhead {
    /// `fill` reads the next messages of the file, and none at its end.
    pub(crate) fn start(path: &Path, fill: impl FnMut(&mut MessageBatch) + Send + 'static) -> Result<Self, ReadError> {
        let mut fill = fill;
        let (sender, batches) = sync_channel(BATCHES_AHEAD);
        let read = move || {
            loop {
                let mut batch = MessageBatch::default();
                fill(&mut batch);
                let is_last = batch.found.is_empty();
                if sender.send(batch).is_err() || is_last {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("reading ahead".into()).spawn(read);
        thread.map_err(|error| ReadError::Io { path: Shown(path.to_owned()), error })?;
        Ok(Self { batches, batch: MessageBatch::default() })
    }

    /// Messages in the order of the file, from the first chunk on that may have some of this time or later.
    pub(crate) fn in_file_order(path: &Path, from_ns: u64) -> Result<Self, ReadError> {
        let contents = Contents::open(path)?;
        let mut contents = Some(match from_ns {
            0 => contents,
            _ => contents.at_first_chunk(|chunk| chunk.message_end_time >= from_ns)?,
        });
        Self::start(path, move |batch| {
            if let Some(reading) = &mut contents
                && has_failed(reading, batch)
            {
                contents = None;
            }
        })
    }

    /// The next message; waits for it. None at the end.
    pub(crate) fn next(&mut self) -> Result<Option<Found>, ReadError> {
        if self.batch.found.is_empty() {
            // The thread has ended behind the last one.
            let Ok(batch) = self.batches.recv() else { return Ok(None) };
            self.batch = batch;
        }
        self.batch.found.pop_front().transpose()
    }

    /// The bytes of the message that came last.
    pub(crate) fn data(&self, found: &Found) -> &[u8] {
        found.data_in(&self.batch.data)
    }

    /// The messages that came last, and those behind them.
    pub(crate) fn batch(&self) -> &MessageBatch {
        &self.batch
    }
}

/// Fills a batch in the order of the file; whether that cannot be read any further.
fn has_failed(contents: &mut Contents, batch: &mut MessageBatch) -> bool {
    while !batch.is_full() {
        match contents.next() {
            Ok(Some(Item::Message(found))) => batch.push(&found, contents.data(&found)),
            Ok(Some(Item::Damaged(at, what))) => batch.fail(contents.damaged(at, what)),
            Ok(Some(Item::Metadata(_) | Item::Attachment(_))) => {}
            Ok(None) => break,
            Err(error) => {
                let is_io = matches!(error, ReadError::Io { .. });
                batch.fail(error);
                return is_io;
            }
        }
    }
    batch.read_bytes = contents.at();
    batch.is_closed = contents.ending() == Some(Ending::Closed);
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::op;
    use std::io::Write;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    /// Five times as many as may wait.
    const BATCHES: usize = 5 * BATCHES_AHEAD;

    /// Batches of an error each; how many were filled.
    fn counted(most: usize) -> (ReadAhead, Arc<AtomicUsize>) {
        let filled = Arc::new(AtomicUsize::new(0));
        let count = filled.clone();
        let fill = move |batch: &mut MessageBatch| {
            if count.fetch_add(1, Relaxed) < most {
                batch.fail(ReadError::NotMcap { path: Shown("a.mcap".into()) });
            }
        };
        (ReadAhead::start(Path::new("a.mcap"), fill).unwrap(), filled)
    }

    #[test]
    fn all_is_read_and_no_more_waits_than_there_is_room_for() {
        let (mut ahead, filled) = counted(BATCHES);
        for taken in 0..BATCHES {
            // Until it stands still, or has read all: one more is filled, and waits for its place.
            let wanted = (taken + BATCHES_AHEAD + 1).min(BATCHES + 1);
            while filled.load(Relaxed) < wanted {
                std::thread::yield_now();
            }
            assert!(filled.load(Relaxed) <= wanted, "{} are filled behind {taken}", filled.load(Relaxed));
            assert!(ahead.next().is_err());
        }
        assert!(matches!((ahead.next(), ahead.next()), (Ok(None), Ok(None))));
    }

    /// As many as a hostile file has: records without bytes, and chunks that unpack to nothing right.
    #[test]
    fn what_has_no_bytes_takes_room_as_well() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(mcap::MAGIC).unwrap();
        let zeros = zstd::encode_all(&vec![0; 16 << 20][..], 1).unwrap();
        let mut chunk = vec![op::CHUNK];
        chunk.extend_from_slice(&(44 + zeros.len() as u64).to_le_bytes());
        chunk.extend_from_slice(&[0; 16]);
        chunk.extend_from_slice(&(16_u64 << 20).to_le_bytes());
        // A sum that it does not have.
        chunk.extend_from_slice(&1_u32.to_le_bytes());
        chunk.extend_from_slice(&4_u32.to_le_bytes());
        chunk.extend_from_slice(b"zstd");
        chunk.extend_from_slice(&(zeros.len() as u64).to_le_bytes());
        chunk.extend_from_slice(&zeros);
        (0..8).for_each(|_| file.write_all(&chunk).unwrap());
        file.write_all(&[0x80, 0, 0, 0, 0, 0, 0, 0, 0].repeat(1 << 20)).unwrap();
        let mut contents = Contents::open(file.path()).unwrap();
        for number in 0..8 {
            let mut batch = MessageBatch::default();
            assert!(!has_failed(&mut contents, &mut batch));
            assert_eq!((batch.found.len(), batch.data.capacity(), batch.is_full()), (1, 0, true), "{number}");
        }
        let mut batch = MessageBatch::default();
        assert!(!has_failed(&mut contents, &mut batch) && batch.found.is_empty() && !batch.is_closed);
    }

    #[test]
    fn the_thread_ends_with_its_reader() {
        let (ahead, filled) = counted(usize::MAX);
        drop(ahead);
        // Only the thread has it, too.
        while Arc::strong_count(&filled) > 1 {
            std::thread::yield_now();
        }
    }
}
