//! The chunk that is being filled: its records, and where among them the messages of each channel are.

use super::records;
use crate::format::op;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::io;

/// Compresses about as fast as lz4 and as well as the default; measured on messages of 1 KiB.
const ZSTD_LEVEL: i32 = 1;
/// As it stands in the file.
pub(super) const COMPRESSION: &str = "zstd";

/// A chunk in memory.
pub(super) struct OpenChunk {
    records: Vec<u8>,
    /// When each message of a channel came, and where its record is. Lists of earlier chunks are kept empty.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    times: Option<(u64, u64)>,
    compressor: zstd::bulk::Compressor<'static>,
}

/// A chunk as it goes to the file.
pub(super) struct PackedChunk {
    /// The chunk's record, and those of its index.
    pub(super) bytes: Vec<u8>,
    /// The first record alone.
    pub(super) chunk_bytes: u64,
    /// Where the index of each channel is, from the chunk's beginning on.
    pub(super) index_at: BTreeMap<u16, u64>,
    /// When the first and the last message came.
    pub(super) times: (u64, u64),
    pub(super) packed_bytes: u64,
    pub(super) unpacked_bytes: u64,
}

impl OpenChunk {
    pub(super) fn new() -> io::Result<Self> {
        let compressor = zstd::bulk::Compressor::new(ZSTD_LEVEL)?;
        Ok(Self { records: Vec::new(), index: BTreeMap::new(), times: None, compressor })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Adds a record of a schema or a channel: its number, then the rest of its body.
    pub(super) fn define(&mut self, op: u8, id: u16, rest: &[u8]) {
        records::put(&mut self.records, op, |body| {
            body.u16(id).raw(rest);
        });
    }

    pub(super) fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let MessageHeader { channel_id, sequence, log_time, publish_time } = *header;
        self.index.entry(channel_id).or_default().push((log_time, self.records.len() as u64));
        let (first, last) = self.times.unwrap_or((log_time, log_time));
        self.times = Some((first.min(log_time), last.max(log_time)));
        records::put(&mut self.records, op::MESSAGE, |body| {
            body.u16(channel_id).u32(sequence).u64(log_time).u64(publish_time).raw(data);
        });
    }

    /// Packs it, and begins the next one.
    pub(super) fn take(&mut self) -> io::Result<PackedChunk> {
        let packed = self.compressor.compress(&self.records)?;
        let (unpacked_bytes, sum) = (self.records.len() as u64, crc32fast::hash(&self.records));
        let times = self.times.take().unwrap_or_default();
        let mut bytes = Vec::with_capacity(packed.len() + 128);
        records::put(&mut bytes, op::CHUNK, |body| {
            body.u64(times.0).u64(times.1).u64(unpacked_bytes).u32(sum).text(COMPRESSION);
            body.u64(packed.len() as u64).raw(&packed);
        });
        let (chunk_bytes, mut index_at) = (bytes.len() as u64, BTreeMap::new());
        for (id, messages) in self.index.iter_mut().filter(|(_, messages)| !messages.is_empty()) {
            index_at.insert(*id, bytes.len() as u64);
            records::put(&mut bytes, op::MESSAGE_INDEX, |body| {
                body.u16(*id).list(|body| {
                    for (log_time, at) in &*messages {
                        body.u64(*log_time).u64(*at);
                    }
                });
            });
            messages.clear();
        }
        self.records.clear();
        // What a long message took is given back.
        self.records.shrink_to(2 * crate::format::CHUNK_BYTES_MAX);
        Ok(PackedChunk { bytes, chunk_bytes, index_at, times, packed_bytes: packed.len() as u64, unpacked_bytes })
    }
}
