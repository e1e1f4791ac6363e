//! The books of records: what was written, and whether what comes of it is so.

use super::stream::StreamPlan;
use crate::sim::chance::Chance;
use rohrpost_mailbox::{OriginRecord, Stamp};
use std::collections::{BTreeMap, HashMap};
use std::sync::OnceLock;

/// Bodies are cut from it: no two parts of it are alike.
const PATTERN_BYTES: usize = 1 << 19;

#[derive(Default)]
pub(crate) struct RecordBooks {
    /// By their place in the plan.
    pub(super) streams: Vec<StreamBook>,
    /// Since all was well, by place and receiver: records that were sent, and those that came whole.
    pub(super) sent: BTreeMap<(u16, u8), u64>,
    pub(super) came: BTreeMap<(u16, u8), u64>,
}

/// What was written of a stream.
#[derive(Default)]
pub(super) struct StreamBook {
    /// By the incarnation of the writer and the sequence.
    written: HashMap<(u32, u64), WrittenRecord>,
    /// How often it was made anew.
    pub(super) generation: u32,
    /// How often that happened, or its module described itself anew: then its replicas begin anew, too.
    pub(super) changes: u32,
    /// How many records were written.
    pub(super) count: u64,
    /// The one that was written last, with the incarnation of its writer.
    pub(super) newest: Option<(u32, u64)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct WrittenRecord {
    pub(super) generation: u32,
    pub(super) stamp: Stamp,
    pub(super) len: usize,
    /// Where its body begins in the pattern.
    pub(super) start: usize,
    /// When it was written, true ns.
    pub(super) at_ns: u64,
}

fn pattern() -> &'static [u8] {
    static PATTERN: OnceLock<Vec<u8>> = OnceLock::new();
    PATTERN.get_or_init(|| {
        let mut bytes = vec![0; PATTERN_BYTES];
        Chance::new(0x9a_77e2).fill(&mut bytes);
        bytes
    })
}

/// A body of so many bytes; each beginning gives another one.
pub(super) fn body(start: usize, len: usize) -> &'static [u8] {
    &pattern()[start..start + len]
}

/// Where the body of a record begins: a function of its stream, its writer's incarnation and its sequence.
pub(super) fn start_of(stream: usize, incarnation: u32, sequence: u64, len: usize) -> usize {
    let key = (stream as u64) << 56 ^ u64::from(incarnation) << 32 ^ sequence;
    (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 24) as usize % (PATTERN_BYTES - len)
}

impl RecordBooks {
    pub(crate) fn new(streams: &[StreamPlan]) -> Self {
        Self { streams: streams.iter().map(|_| StreamBook::default()).collect(), ..Self::default() }
    }

    pub(super) fn note(&mut self, stream: usize, (incarnation, sequence): (u32, u64), record: WrittenRecord) {
        let book = &mut self.streams[stream];
        book.written.insert((incarnation, sequence), record);
        (book.count, book.newest) = (book.count + 1, Some((incarnation, sequence)));
    }

    /// The record that something says that it is, or is a part of; else what is wrong with it.
    pub(super) fn find(
        &self,
        stream: usize,
        says: &OriginRecord,
        (offset, bytes): (usize, &[u8]),
    ) -> Result<WrittenRecord, String> {
        let Some(book) = self.streams.get(stream) else { return Err(format!("there is no stream {stream}")) };
        let Some(record) = book.written.get(&(says.incarnation, says.sequence)) else {
            return Err(format!("nobody wrote {says:?} of stream {stream}"));
        };
        let end = offset + bytes.len();
        if (says.stamp, says.len_bytes) != (record.stamp, record.len) || end > record.len {
            return Err(format!("{says:?} of stream {stream} was written as {record:?}"));
        }
        if body(record.start, record.len)[offset..end] != *bytes {
            return Err(format!(
                "bytes {offset}..{end} of {says:?} of stream {stream} are not those that were written"
            ));
        }
        Ok(*record)
    }

    pub(super) fn newest(&self, stream: usize) -> Option<(u64, WrittenRecord)> {
        let book = &self.streams[stream];
        let newest = book.newest?;
        Some((newest.1, *book.written.get(&newest)?))
    }

    /// A record by its writer's incarnation and its sequence.
    pub(super) fn get(&self, stream: usize, incarnation: u32, sequence: u64) -> Option<&WrittenRecord> {
        self.streams[stream].written.get(&(incarnation, sequence))
    }
}
