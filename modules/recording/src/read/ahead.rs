//! A thread that reads a file ahead: records are read, and chunks unpacked, before they are asked for.
//!
//! Unpacking a chunk takes milliseconds, and a disk may take longer. A replay, which plays messages at their times, has
//! none to spare. What waits is bounded, so memory stays the same however long the file is.

use crate::error::{Damage, ReadError};
use crate::format::op;
use crate::read::chunk;
use crate::read::frames::{Frames, Step};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// The thread reads on while fewer bytes wait: some chunks of ours, more than a burst of pictures and clouds fills.
const AHEAD_BYTES: usize = 8 << 20;
/// Buffers that were used and are kept for what is read next, and the largest of them: none of ours is larger, unless
/// for a single message.
const SPARE_MAX: usize = 4;
const SPARE_BYTES_MAX: usize = 2 << 20;

/// Records of a file, read by a thread. It ends with this.
pub(crate) struct ReadAhead(Arc<Passage>);

/// What is at a place of a file.
pub(crate) struct AheadRecord {
    /// Where it begins.
    pub(crate) begins: u64,
    /// Where the next one does.
    pub(crate) ends: u64,
    pub(crate) step: Result<Step, ReadError>,
    /// Its bytes; of a chunk that was unpacked, the records in it.
    pub(crate) body: Vec<u8>,
    /// Of a whole chunk: whether it could be unpacked.
    pub(crate) unpacked: Option<Result<(), Damage>>,
}

/// What the thread and its reader share.
#[derive(Default)]
struct Passage {
    waiting: Mutex<WaitingRecords>,
    changed: Condvar,
}

#[derive(Default)]
struct WaitingRecords {
    records: VecDeque<AheadRecord>,
    bytes: usize,
    spare: Vec<Vec<u8>>,
    /// The thread reads no further, or nobody wants it to.
    is_over: bool,
}

impl ReadAhead {
    /// Reads from where these frames are. None if there is no thread to be had.
    pub(crate) fn start(frames: Frames) -> Option<Self> {
        let passage = Arc::new(Passage::default());
        let own = passage.clone();
        let read = move || {
            // Also if it panics: its reader must not wait for ever.
            let _end = EndOfReading(&own);
            read_all(frames, &own);
        };
        let thread = std::thread::Builder::new().name("reading ahead".into()).spawn(read);
        thread.is_ok().then_some(Self(passage))
    }

    /// The next record; waits for it. None once the thread has ended: behind the last record, or an error.
    pub(crate) fn next(&mut self) -> Option<AheadRecord> {
        let mut waiting = self.0.lock();
        loop {
            if let Some(record) = waiting.records.pop_front() {
                waiting.bytes -= record.body.len();
                self.0.changed.notify_all();
                return Some(record);
            }
            if waiting.is_over {
                return None;
            }
            waiting = self.0.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// A buffer that is used no more.
    pub(crate) fn give_back(&mut self, buffer: Vec<u8>) {
        let mut waiting = self.0.lock();
        if waiting.spare.len() < SPARE_MAX && buffer.capacity() <= SPARE_BYTES_MAX {
            waiting.spare.push(buffer);
        }
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        self.0.end();
    }
}

struct EndOfReading<'a>(&'a Passage);

impl Drop for EndOfReading<'_> {
    fn drop(&mut self) {
        self.0.end();
    }
}

impl Passage {
    fn lock(&self) -> MutexGuard<'_, WaitingRecords> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    /// A buffer for the next record, once there is room for it; none if nobody wants it any more.
    fn room(&self) -> Option<Vec<u8>> {
        let mut waiting = self.lock();
        while waiting.bytes >= AHEAD_BYTES && !waiting.is_over {
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
        (!waiting.is_over).then(|| waiting.spare.pop().unwrap_or_default())
    }

    fn put(&self, record: AheadRecord) {
        let mut waiting = self.lock();
        waiting.bytes += record.body.len();
        waiting.records.push_back(record);
        self.changed.notify_all();
    }
}

fn read_all(mut frames: Frames, passage: &Passage) {
    while let Some(mut body) = passage.room() {
        let (mut begins, mut step) = (frames.at(), frames.step());
        // They say where messages are in a chunk, and these are read in turn.
        while matches!(step, Ok(Step::Record(op::MESSAGE_INDEX))) {
            (begins, step) = (frames.at(), frames.step());
        }
        let mut unpacked = None;
        if matches!(step, Ok(Step::Record(op::CHUNK))) {
            unpacked = Some(chunk::unpack(frames.body(), &mut body));
        } else {
            frames.swap_body(&mut body);
        }
        let goes_on = matches!(step, Ok(Step::Record(op)) if op != op::FOOTER);
        passage.put(AheadRecord { begins, ends: frames.at(), step, body, unpacked });
        if !goes_on {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// Of each record.
    const BYTES: usize = 1 << 20;
    /// Five times as many as may wait.
    const RECORDS: usize = 5 * AHEAD_BYTES / BYTES;

    /// A file of records that say nothing.
    fn file() -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(mcap::MAGIC).unwrap();
        let mut record = vec![0; BYTES];
        record[0] = 0x80;
        record[1..9].copy_from_slice(&(BYTES as u64 - 9).to_le_bytes());
        (0..RECORDS).for_each(|_| file.write_all(&record).unwrap());
        file
    }

    #[test]
    fn all_is_read_and_no_more_waits_than_there_is_room_for() {
        let file = file();
        let mut ahead = ReadAhead::start(Frames::open(file.path()).unwrap()).unwrap();
        let mut ends = Vec::new();
        while let Some(record) = ahead.next() {
            ends.push((record.ends, record.step.unwrap()));
            // Until it stands still, or has read all.
            loop {
                let waiting = ahead.0.lock();
                assert!(waiting.bytes < AHEAD_BYTES + BYTES, "{} bytes wait", waiting.bytes);
                assert!(waiting.spare.len() <= SPARE_MAX);
                if waiting.is_over || waiting.bytes >= AHEAD_BYTES {
                    break;
                }
                drop(waiting);
                std::thread::yield_now();
            }
            ahead.give_back(record.body);
        }
        let end = |number: usize| (mcap::MAGIC.len() + number * BYTES) as u64;
        let records = (1..=RECORDS).map(|number| (end(number), Step::Record(0x80)));
        assert_eq!(ends, records.chain([(end(RECORDS), Step::End)]).collect::<Vec<_>>());
    }

    #[test]
    fn the_thread_ends_with_its_reader() {
        let file = file();
        let ahead = ReadAhead::start(Frames::open(file.path()).unwrap()).unwrap();
        let passage = Arc::downgrade(&ahead.0);
        drop(ahead);
        // Only the thread has it now.
        while passage.strong_count() > 0 {
            std::thread::yield_now();
        }
    }
}
