//! A thread that reads a file ahead: records are read, and chunks unpacked, before they are asked for.
//!
//! Unpacking a chunk takes milliseconds, and a disk may take longer. A replay, which plays messages at their times, has
//! none to spare. What waits is bounded, so memory stays the same however long the file is.

use crate::error::{Damage, ReadError};
use crate::format::op;
use crate::read::chunk;
use crate::read::frames::{Frames, HEAD_BYTES, Step};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// The thread reads on while less memory waits: some chunks of ours, more than a burst of pictures and clouds fills.
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
    /// From where on records are searched for if this is none, or behind this one: behind an index of messages that was
    /// passed over, and of a chunk that was unpacked.
    pub(crate) resume_at: Option<u64>,
    pub(crate) step: Result<Step, ReadError>,
    /// Its bytes; of a chunk that was unpacked, the records in it.
    pub(crate) body: Vec<u8>,
    /// Of a whole chunk: whether it could be unpacked.
    pub(crate) unpacked: Option<Result<(), Damage>>,
}

impl AheadRecord {
    /// Memory that it takes, also if it has no bytes.
    fn memory(&self) -> usize {
        size_of::<Self>() + self.body.capacity()
    }
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
    /// Memory of these.
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
                waiting.bytes -= record.memory();
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
        self.0.lock().keep(buffer);
    }
}

impl WaitingRecords {
    fn keep(&mut self, buffer: Vec<u8>) {
        if self.spare.len() < SPARE_MAX && buffer.capacity() <= SPARE_BYTES_MAX {
            self.spare.push(buffer);
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

    fn is_over(&self) -> bool {
        self.lock().is_over
    }

    fn put(&self, mut record: AheadRecord) {
        // A few bytes in a large buffer are copied: that serves the next large record.
        let large = (record.body.len() < record.body.capacity() / 4).then(|| {
            let exact = record.body.as_slice().into();
            std::mem::replace(&mut record.body, exact)
        });
        let mut waiting = self.lock();
        large.into_iter().for_each(|buffer| waiting.keep(buffer));
        waiting.bytes += record.memory();
        waiting.records.push_back(record);
        self.changed.notify_all();
    }
}

fn read_all(mut frames: Frames, passage: &Passage) {
    while let Some(mut body) = passage.room() {
        let (mut begins, mut step, mut resume_at) = (frames.at(), frames.step(), None);
        // They say where messages are in a chunk, and these are read in turn.
        while let Ok(Step::Record(op @ op::MESSAGE_INDEX)) = step
            && chunk::is_exact(op, frames.body())
            && !passage.is_over()
        {
            resume_at = Some(frames.at());
            (begins, step) = (frames.at(), frames.step());
        }
        let mut unpacked = None;
        if let Ok(Step::Record(op @ op::CHUNK)) = step {
            let is_exact = chunk::is_exact(op, frames.body());
            resume_at = Some(if is_exact { frames.at() } else { begins + HEAD_BYTES as u64 });
            unpacked = Some(chunk::unpack(frames.body(), &mut body));
        } else {
            frames.swap_body(&mut body);
        }
        let goes_on = matches!(step, Ok(Step::Record(op)) if op != op::FOOTER);
        passage.put(AheadRecord { begins, ends: frames.at(), resume_at, step, body, unpacked });
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
                assert!(waiting.bytes < AHEAD_BYTES + 2 * BYTES + 1024, "{} bytes wait", waiting.bytes);
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

    /// As many as a hostile file has: records without bytes, and chunks that unpack to nothing right.
    #[test]
    fn what_has_no_bytes_takes_room_as_well() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(mcap::MAGIC).unwrap();
        let zeros = zstd_of_zeros(16 << 20);
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
        let empty = [0x80, 0, 0, 0, 0, 0, 0, 0, 0];
        (0..8).for_each(|_| file.write_all(&chunk).unwrap());
        file.write_all(&empty.repeat(2 * AHEAD_BYTES / size_of::<AheadRecord>())).unwrap();
        let mut ahead = ReadAhead::start(Frames::open(file.path()).unwrap()).unwrap();
        loop {
            let waiting = ahead.0.lock();
            let memory: usize = waiting.records.iter().map(AheadRecord::memory).sum();
            assert!(memory == waiting.bytes && memory < AHEAD_BYTES + 1024, "{memory} bytes wait");
            if waiting.bytes >= AHEAD_BYTES {
                break;
            }
            assert!(!waiting.is_over, "all of it waits");
            drop(waiting);
            std::thread::yield_now();
        }
        for _ in 0..8 {
            assert!(ahead.next().unwrap().unpacked.unwrap().is_err());
        }
        assert_eq!(ahead.next().unwrap().step.unwrap(), Step::Record(0x80));
    }

    fn zstd_of_zeros(bytes: usize) -> Vec<u8> {
        zstd::encode_all(&vec![0; bytes][..], 1).unwrap()
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
