//! What stands at the end of a closed file: definitions, statistics, and where everything is.

use super::chunk::{COMPRESSION, PackedChunk};
use super::records;
use crate::format::op;
use mcap::records::{AttachmentIndex, ChunkIndex, MessageHeader, MetadataIndex};
use std::collections::BTreeMap;

/// What is noted for it while the file is written.
#[derive(Default)]
pub(super) struct Summary {
    chunks: Vec<ChunkIndex>,
    pub(super) attachments: Vec<AttachmentIndex>,
    pub(super) metadata: Vec<MetadataIndex>,
    counts: BTreeMap<u16, u64>,
    times: Option<(u64, u64)>,
}

impl Summary {
    pub(super) fn count(&mut self, header: &MessageHeader) {
        *self.counts.entry(header.channel_id).or_default() += 1;
        let (first, last) = self.times.unwrap_or((header.log_time, header.log_time));
        self.times = Some((first.min(header.log_time), last.max(header.log_time)));
    }

    /// Notes a chunk that is in the file there.
    pub(super) fn chunk(&mut self, at: u64, packed: &PackedChunk) {
        let index_at = packed.index_at.iter().map(|(id, offset)| (*id, at + offset)).collect();
        self.chunks.push(ChunkIndex {
            message_start_time: packed.times.0,
            message_end_time: packed.times.1,
            chunk_start_offset: at,
            chunk_length: packed.chunk_bytes,
            message_index_offsets: index_at,
            message_index_length: packed.bytes.len() as u64 - packed.chunk_bytes,
            compression: COMPRESSION.to_owned(),
            compressed_size: packed.packed_bytes,
            uncompressed_size: packed.unpacked_bytes,
        });
    }

    /// The end of the file behind its data, which end at `at`; `schemas` and `channels` are their records.
    pub(super) fn bytes(&self, at: u64, schemas: DefinitionRecords, channels: DefinitionRecords) -> Vec<u8> {
        let mut statistics = Vec::new();
        records::put(&mut statistics, op::STATISTICS, |body| {
            let (first, last) = self.times.unwrap_or_default();
            body.u64(self.counts.values().sum()).u16(schemas.count).u32(channels.count.into());
            body.u32(self.attachments.len() as u32).u32(self.metadata.len() as u32).u32(self.chunks.len() as u32);
            body.u64(first).u64(last).list(|body| {
                for (id, count) in &self.counts {
                    body.u16(*id).u64(*count);
                }
            });
        });
        let groups = [
            (op::SCHEMA, schemas.records),
            (op::CHANNEL, channels.records),
            (op::STATISTICS, statistics),
            (op::CHUNK_INDEX, self.chunk_records()),
            (op::ATTACHMENT_INDEX, self.attachment_records()),
            (op::METADATA_INDEX, self.metadata_records()),
        ];
        let (mut all, mut offsets) = (Vec::new(), Vec::new());
        for (op, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let group_at = at + all.len() as u64;
            records::put(&mut offsets, op::SUMMARY_OFFSET, |body| {
                body.u8(op).u64(group_at).u64(records.len() as u64);
            });
            all.extend_from_slice(&records);
        }
        let offsets_at = at + all.len() as u64;
        all.extend_from_slice(&offsets);
        records::put(&mut all, op::FOOTER, |body| {
            body.u64(at).u64(offsets_at).u32(0);
        });
        // The last field is the sum of all before it.
        let sum_at = all.len() - size_of::<u32>();
        let sum = crc32fast::hash(&all[..sum_at]);
        all[sum_at..].copy_from_slice(&sum.to_le_bytes());
        all.extend_from_slice(mcap::MAGIC);
        all
    }

    fn chunk_records(&self) -> Vec<u8> {
        each(op::CHUNK_INDEX, &self.chunks, |body, chunk| {
            body.u64(chunk.message_start_time).u64(chunk.message_end_time);
            body.u64(chunk.chunk_start_offset).u64(chunk.chunk_length);
            body.list(|body| {
                for (id, at) in &chunk.message_index_offsets {
                    body.u16(*id).u64(*at);
                }
            });
            body.u64(chunk.message_index_length).text(&chunk.compression);
            body.u64(chunk.compressed_size).u64(chunk.uncompressed_size);
        })
    }

    fn attachment_records(&self) -> Vec<u8> {
        each(op::ATTACHMENT_INDEX, &self.attachments, |body, its| {
            body.u64(its.offset).u64(its.length).u64(its.log_time).u64(its.create_time).u64(its.data_size);
            body.text(&its.name).text(&its.media_type);
        })
    }

    fn metadata_records(&self) -> Vec<u8> {
        each(op::METADATA_INDEX, &self.metadata, |body, its| {
            body.u64(its.offset).u64(its.length).text(&its.name);
        })
    }
}

/// A record for each of these.
fn each<T>(op: u8, all: &[T], fill: impl Fn(&mut records::Body<'_>, &T)) -> Vec<u8> {
    let mut out = Vec::new();
    all.iter().for_each(|its| records::put(&mut out, op, |body| fill(body, its)));
    out
}

/// Records of all schemas, or of all channels.
#[derive(Default)]
pub(super) struct DefinitionRecords {
    pub(super) count: u16,
    pub(super) records: Vec<u8>,
}

impl DefinitionRecords {
    pub(super) fn add(&mut self, op: u8, id: u16, rest: &[u8]) {
        self.count += 1;
        records::put(&mut self.records, op, |body| {
            body.u16(id).raw(rest);
        });
    }
}
