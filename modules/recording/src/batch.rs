//! Messages that wait to be compressed: those of one chunk, in the order in which they came.

use crate::format::{CHUNK_BYTES_MAX, MESSAGE_OVERHEAD_BYTES};

/// A message, as it is recorded.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// When it came, in nanoseconds of system time: MCAP's log time.
    pub arrival_ns: u64,
    /// When it was true, in nanoseconds of system time: MCAP's publish time.
    pub stamp_ns: u64,
    /// Which stretch of system time between two steps of it the stamp is of.
    pub epoch: u64,
    /// Its number, as what published it counts: a gap shows where messages are missing.
    pub sequence: u32,
    /// Its bytes, in postcard.
    pub data: &'a [u8],
}

/// One of a batch, without its data.
struct Entry {
    channel: usize,
    arrival_ns: u64,
    stamp_ns: u64,
    epoch: u64,
    sequence: u32,
    len: usize,
}

/// Messages of one chunk.
#[derive(Default)]
pub(crate) struct Batch {
    entries: Vec<Entry>,
    data: Vec<u8>,
}

impl Batch {
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// What the chunk takes before compression.
    pub(crate) fn bytes(&self) -> usize {
        self.data.len() + self.entries.len() * MESSAGE_OVERHEAD_BYTES
    }

    /// Whether one more of a length fits; a long one has a chunk of its own.
    pub(crate) fn has_room(&self, len: usize) -> bool {
        self.is_empty() || self.bytes() + MESSAGE_OVERHEAD_BYTES + len <= CHUNK_BYTES_MAX
    }

    pub(crate) fn push(&mut self, channel: usize, message: &Message<'_>) {
        let Message { arrival_ns, stamp_ns, epoch, sequence, data } = *message;
        self.entries.push(Entry { channel, arrival_ns, stamp_ns, epoch, sequence, len: data.len() });
        self.data.extend_from_slice(data);
    }

    /// All of them, with the numbers of their channels.
    pub(crate) fn messages(&self) -> impl Iterator<Item = (usize, Message<'_>)> {
        let mut rest = &self.data[..];
        self.entries.iter().map(move |entry| {
            let (data, behind) = rest.split_at(entry.len);
            rest = behind;
            let Entry { channel, arrival_ns, stamp_ns, epoch, sequence, .. } = *entry;
            (channel, Message { arrival_ns, stamp_ns, epoch, sequence, data })
        })
    }

    /// Makes it empty, to be filled again. What a long message took is given back.
    pub(crate) fn clear(&mut self) {
        self.entries.clear();
        self.data.clear();
        self.data.shrink_to(CHUNK_BYTES_MAX);
    }
}
