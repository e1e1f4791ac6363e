//! Messages of a file in the order of time, wherever they are in it: programs of others need not write them so.
//!
//! ```text
//! stretches of the file, by their first message ──▶ held, sorted ──the earliest of all──▶ batches ──▶ Reader
//!                                                         (a thread, some megabytes ahead)
//! ```
//!
//! A stretch is a chunk, or messages outside of chunks. It is held from its first message on until its last one was
//! taken: as many are in memory as overlap in time. Among messages of one time the file's order stays.

use crate::error::{Damage, FileLimit, ReadError};
use crate::format::HELD_BYTES_MAX;
use crate::read::contents::{Contents, Ending, Found, Item};
use crate::read::definitions::Definitions;
use crate::read::frames::Frames;
use crate::read::index::Index;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::vec;

/// Messages outside of chunks make stretches of this length.
const STRETCH_BYTES: u64 = 1 << 20;
/// So much is handed over at once, unless one message is longer, and so often ahead.
const BATCH_BYTES: usize = 1 << 20;
const BATCHES_AHEAD: usize = 2;

/// A part of the file, and the times of its messages.
#[derive(Clone, Copy)]
struct Stretch {
    begins: u64,
    ends: u64,
    first_ns: u64,
    last_ns: u64,
}

/// Where in a file which times are.
#[derive(Clone)]
pub(crate) struct TimePlan {
    definitions: Definitions,
    /// By their first message.
    stretches: Arc<Vec<Stretch>>,
    is_closed: bool,
    /// What is wrong with the file first.
    damage: Option<(u64, Damage)>,
    held_bytes_max: usize,
}

/// Messages that follow each other in time.
#[derive(Default)]
pub(crate) struct OrderedBatch {
    pub(crate) data: Vec<u8>,
    pub(crate) found: VecDeque<Found>,
    /// So many bytes of the file are read.
    pub(crate) read_bytes: u64,
}

impl TimePlan {
    /// By the index, if that lists all chunks; else by reading the file.
    pub(crate) fn of(path: &Path) -> Result<Self, ReadError> {
        let index = match Index::read(&mut Frames::open(path)?) {
            Ok(index) if index.knows_all_chunks() && index.describes_all_channels() => index,
            Ok(_) | Err(ReadError::NotClosed { .. } | ReadError::Damaged { .. }) => return Self::by_reading(path),
            Err(error) => return Err(error),
        };
        let chunks = index.chunks.iter().filter(|chunk| chunk.message_index_length > 0 || chunk.message_end_time > 0);
        let stretches = chunks.map(|chunk| Stretch {
            begins: chunk.chunk_start_offset,
            ends: chunk.chunk_start_offset.saturating_add(chunk.chunk_length),
            first_ns: chunk.message_start_time,
            last_ns: chunk.message_end_time,
        });
        Ok(Self::new(index.definitions.clone(), stretches.collect(), true, None))
    }

    fn new(
        definitions: Definitions,
        mut stretches: Vec<Stretch>,
        is_closed: bool,
        damage: Option<(u64, Damage)>,
    ) -> Self {
        stretches.sort_by_key(|its| (its.first_ns, its.begins));
        Self { definitions, stretches: Arc::new(stretches), is_closed, damage, held_bytes_max: HELD_BYTES_MAX }
    }

    fn by_reading(path: &Path) -> Result<Self, ReadError> {
        let mut contents = Contents::open(path)?;
        let (mut stretches, mut damage): (Vec<Stretch>, _) = (Vec::new(), None);
        while let Some(item) = contents.next()? {
            let found = match item {
                Item::Message(found) => found,
                Item::Damaged(at, what) => {
                    damage.get_or_insert((at, what));
                    continue;
                }
                Item::Metadata(_) | Item::Attachment(_) => continue,
            };
            let (begins, ends, log_ns) = (contents.begins(), contents.at(), found.header.log_time);
            match stretches.last_mut() {
                Some(last) if last.takes(begins, ends, found.is_in_chunk()) => {
                    (last.first_ns, last.last_ns) = (last.first_ns.min(log_ns), last.last_ns.max(log_ns));
                    last.ends = ends;
                }
                _ => stretches.push(Stretch { begins, ends, first_ns: log_ns, last_ns: log_ns }),
            }
        }
        let is_closed = contents.ending() == Some(Ending::Closed);
        Ok(Self::new(contents.definitions().clone(), stretches, is_closed, damage))
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Messages from a time on, read by a thread that ends with its receiver.
    pub(crate) fn read(
        &self,
        path: &Path,
        from_ns: u64,
    ) -> Result<Receiver<Result<OrderedBatch, ReadError>>, ReadError> {
        let mut ordered = Ordered::new(self.clone(), Frames::open(path)?, from_ns);
        let (batches, receiver) = sync_channel(BATCHES_AHEAD);
        let read = move || {
            loop {
                let told = ordered.batch();
                let is_last = told.as_ref().map_or(true, |batch| batch.found.is_empty());
                if batches.send(told).is_err() || is_last {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("reading in order".into()).spawn(read);
        thread.map_err(|error| ReadError::Io { path: crate::Shown(path.to_owned()), error })?;
        Ok(receiver)
    }
}

impl Stretch {
    /// Whether a message of the file's next record, or of the same chunk, is of it.
    fn takes(&self, begins: u64, ends: u64, is_in_chunk: bool) -> bool {
        if is_in_chunk { self.begins == begins } else { ends - self.begins <= STRETCH_BYTES && self.ends == begins }
    }
}

/// A file that is read in the order of time.
struct Ordered {
    contents: Contents,
    /// Not held yet.
    stretches: vec::IntoIter<Stretch>,
    next: Option<Stretch>,
    /// Held ones, by where they begin.
    held: BTreeMap<u64, HeldStretch>,
    /// The next message of each.
    earliest: BinaryHeap<Reverse<(u64, u64)>>,
    held_bytes: usize,
    held_bytes_max: usize,
    read_bytes: u64,
    from_ns: u64,
    damage: Option<(u64, Damage)>,
}

/// Messages of a stretch, sorted.
struct HeldStretch {
    data: Vec<u8>,
    found: VecDeque<Found>,
}

/// What so many messages with these data take; they need not have any.
fn memory(data: &[u8], messages: usize) -> usize {
    data.len() + messages * size_of::<Found>()
}

impl HeldStretch {
    fn memory(&self) -> usize {
        self.data.capacity() + self.found.capacity() * size_of::<Found>()
    }
}

impl Ordered {
    fn new(plan: TimePlan, frames: Frames, from_ns: u64) -> Self {
        let stretches = plan.stretches.iter().filter(|its| its.last_ns >= from_ns).copied().collect::<Vec<_>>();
        let mut stretches = stretches.into_iter();
        Self {
            contents: Contents::new(frames, plan.definitions),
            next: stretches.next(),
            stretches,
            held: BTreeMap::new(),
            earliest: BinaryHeap::new(),
            held_bytes: 0,
            held_bytes_max: plan.held_bytes_max,
            read_bytes: 0,
            from_ns,
            damage: plan.damage,
        }
    }

    /// The next messages; none at the end. What is wrong with the file is told behind its last message.
    fn batch(&mut self) -> Result<OrderedBatch, ReadError> {
        let mut batch = OrderedBatch::default();
        while memory(&batch.data, batch.found.len()) < BATCH_BYTES {
            if let Some(next) = self.next.filter(|its| self.earliest_ns().is_none_or(|ns| its.first_ns <= ns)) {
                self.hold(next)?;
                self.next = self.stretches.next();
                continue;
            }
            let Some(Reverse((_, begins))) = self.earliest.pop() else { break };
            let Some(held) = self.held.get_mut(&begins) else { continue };
            if let Some(found) = held.found.pop_front() {
                batch.found.push_back({
                    let bytes = found.data_in(&held.data);
                    found.copied(bytes, &mut batch.data)
                });
            }
            match held.found.front() {
                Some(next) => self.earliest.push(Reverse((next.header.log_time, begins))),
                None => self.held_bytes -= self.held.remove(&begins).map_or(0, |its| its.memory()),
            }
        }
        batch.read_bytes = self.read_bytes;
        match self.damage.take_if(|_| batch.found.is_empty()) {
            Some((at, what)) => Err(self.contents.damaged(at, what)),
            None => Ok(batch),
        }
    }

    fn earliest_ns(&self) -> Option<u64> {
        self.earliest.peek().map(|Reverse((ns, _))| *ns)
    }

    /// Reads a stretch.
    fn hold(&mut self, stretch: Stretch) -> Result<(), ReadError> {
        let Stretch { begins, ends, .. } = stretch;
        let (mut data, mut found) = (Vec::new(), Vec::new());
        self.contents.read_again(begins)?;
        while let Some(item) = self.contents.next_before(ends)? {
            match item {
                Item::Message(its) if its.header.log_time >= self.from_ns => {
                    let bytes = self.contents.data(&its);
                    if self.held_bytes + memory(&data, found.len() + 1) + bytes.len() > self.held_bytes_max {
                        return Err(self.contents.too_much(FileLimit::Disorder));
                    }
                    found.push(its.copied(bytes, &mut data));
                }
                Item::Damaged(at, what) => drop(self.damage.get_or_insert((at, what))),
                Item::Message(_) | Item::Metadata(_) | Item::Attachment(_) => {}
            }
        }
        // Stable.
        found.sort_by_key(|its: &Found| its.header.log_time);
        let held = HeldStretch { data, found: found.into() };
        self.read_bytes += ends - begins;
        if let Some(first) = held.found.front() {
            self.held_bytes += held.memory();
            self.earliest.push(Reverse((first.header.log_time, begins)));
            self.held.insert(begins, held);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::WriteOptions;
    use mcap::records::MessageHeader;

    const BYTES: usize = 10_000;

    /// A file with these chunks, each with messages of these times.
    fn file(chunks: &[&[u64]]) -> tempfile::NamedTempFile {
        file_of(chunks, &[7; BYTES])
    }

    fn file_of(chunks: &[&[u64]], data: &[u8]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut writer = WriteOptions::new().chunk_size(None).compression(None).create(file.reopen().unwrap()).unwrap();
        let channel_id = writer.add_channel(0, "/a", "raw", &BTreeMap::new()).unwrap();
        for times in chunks {
            for log_time in *times {
                let header = MessageHeader { channel_id, sequence: 0, log_time: *log_time, publish_time: 0 };
                writer.write_to_known_channel(&header, data).unwrap();
            }
            writer.flush().unwrap();
        }
        writer.finish().unwrap();
        file
    }

    /// When messages come, and what is told behind them.
    fn times(plan: &TimePlan, path: &Path) -> (Vec<u64>, Option<ReadError>) {
        let mut all = Vec::new();
        for told in plan.read(path, 0).unwrap() {
            match told {
                Ok(batch) => all.extend(batch.found.iter().map(|found| found.header.log_time)),
                Err(error) => return (all, Some(error)),
            }
        }
        (all, None)
    }

    #[test]
    fn as_much_is_held_as_overlaps_and_no_more() {
        for (chunks, chunks_held) in [
            (&[&[3, 1, 2][..], &[6, 5, 4], &[7, 9, 8]][..], 1),
            (&[&[7, 1, 8], &[9, 2, 3], &[5, 4, 6]], 3),
            (&[&[9, 8, 7], &[1, 2, 3], &[6, 5, 4]], 1),
        ] {
            let file = file(chunks);
            let mut plan = TimePlan::of(file.path()).unwrap();
            plan.held_bytes_max = chunks_held * 4 * BYTES;
            let (told, error) = times(&plan, file.path());
            assert_eq!((told, error.map(|error| error.to_string())), ((1..10).collect(), None), "{chunks:?}");
            plan.held_bytes_max = (chunks_held * 3 - 1) * BYTES;
            let error = times(&plan, file.path()).1.unwrap();
            assert!(matches!(error, ReadError::TooMuch { limit: FileLimit::Disorder, .. }), "{chunks:?}: {error}");
        }
    }

    #[test]
    fn messages_without_data_take_room_as_well() {
        const MESSAGES: usize = 3 * BATCH_BYTES / size_of::<Found>();
        let file = file_of(&[&[1; MESSAGES]], &[]);
        let mut plan = TimePlan::of(file.path()).unwrap();
        let batches: Vec<usize> =
            plan.read(file.path(), 0).unwrap().into_iter().map(|told| told.unwrap().found.len()).collect();
        assert_eq!(batches.iter().sum::<usize>(), MESSAGES);
        assert!(
            batches.iter().all(|count| count * size_of::<Found>() < BATCH_BYTES + size_of::<Found>()),
            "{batches:?}"
        );
        plan.held_bytes_max = BATCH_BYTES;
        let error = times(&plan, file.path()).1;
        assert!(matches!(error, Some(ReadError::TooMuch { limit: FileLimit::Disorder, .. })), "{error:?}");
    }

    #[test]
    fn what_is_wrong_is_told_behind_the_last_message() {
        let file = file(&[&[3, 1, 2], &[6, 5, 4]]);
        let bytes = std::fs::read(file.path()).unwrap();
        let mut frames = Frames::open(file.path()).unwrap();
        let last = Index::read(&mut frames).unwrap().chunks[1].chunk_start_offset as usize;
        let cut = last + 9 + 40 + 2 * BYTES + 1_000;
        std::fs::write(file.path(), &bytes[..cut]).unwrap();
        let (told, error) = times(&TimePlan::of(file.path()).unwrap(), file.path());
        assert_eq!(told, [1, 2, 3, 5, 6], "one is cut off");
        assert!(matches!(error, Some(ReadError::Damaged { what: Damage::Cut, .. })), "{error:?}");
    }
}
