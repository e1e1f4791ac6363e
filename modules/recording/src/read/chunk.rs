//! A chunk: unpacked and checked, or unpacked as far as it goes.

use crate::error::{Damage, FileLimit};
use crate::format::{RECORD_BYTES_MAX, op};
use crate::read::frames::HEAD_BYTES;
use std::io::Read;
use std::ops::Range;

/// Memory for unpacking is at most that of the longest chunk; what is compressed here needs less.
const WINDOW_LOG_MAX: u32 = RECORD_BYTES_MAX.ilog2();

/// What is before a chunk's records.
struct Header<'a> {
    unpacked_bytes: u64,
    sum: u32,
    compression: &'a [u8],
    packed_bytes: u64,
}

/// Takes fields off the front.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.bytes(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.bytes(8)?.try_into().ok()?))
    }
}

/// Header and packed records. Nothing if it ends in the header.
fn split(body: &[u8]) -> Option<(Header<'_>, &[u8])> {
    let mut fields = Fields(body);
    let (_start_ns, _end_ns) = (fields.u64()?, fields.u64()?);
    let (unpacked_bytes, sum) = (fields.u64()?, fields.u32()?);
    let compression_len = fields.u32()?;
    let compression = fields.bytes(compression_len as usize)?;
    let packed_bytes = fields.u64()?;
    Some((Header { unpacked_bytes, sum, compression, packed_bytes }, fields.0))
}

/// So many bytes of a chunk's body say how long it is.
pub(crate) const EXTENT_BYTES: usize = 8 + 8 + 8 + 4 + 4 + 4 + 8;

/// How long the body of a chunk is, by what stands in it; nothing if it is none that is known here.
pub(crate) fn extent(body: &[u8]) -> Option<u64> {
    let (header, packed) = split(body)?;
    let is_known = matches!(header.compression, b"" | b"zstd" | b"lz4");
    let header_bytes = (body.len() - packed.len()) as u64;
    header_bytes.checked_add(header.packed_bytes).filter(|_| is_known)
}

/// Whether this begins the body of an index of messages that is so long: channel, length of a list, its pairs of time
/// and place.
pub(crate) fn is_index(body: &[u8], len: u64) -> bool {
    let list_bytes = body.get(2..).and_then(<[u8]>::first_chunk).map(|bytes| u64::from(u32::from_le_bytes(*bytes)));
    list_bytes.is_some_and(|bytes| bytes % 16 == 0 && 6 + bytes == len)
}

/// Whether a record says twice how long it is, and the same: it ends where it says.
pub(crate) fn is_exact(op: u8, body: &[u8]) -> bool {
    let len = body.len() as u64;
    match op {
        op::CHUNK => extent(body) == Some(len),
        op::MESSAGE_INDEX => is_index(body, len),
        _ => false,
    }
}

/// Unpacks a chunk's records, checked by their sum: all or nothing.
pub(crate) fn unpack(body: &[u8], records: &mut Vec<u8>) -> Result<(), Damage> {
    records.clear();
    let told = unpack_checked(body, records);
    if told.is_err() {
        records.clear();
    }
    told
}

fn unpack_checked(body: &[u8], records: &mut Vec<u8>) -> Result<(), Damage> {
    let (header, packed) = split(body).ok_or(Damage::ChunkSum)?;
    let packed = usize::try_from(header.packed_bytes).ok().and_then(|len| packed.get(..len)).ok_or(Damage::ChunkSum)?;
    if header.unpacked_bytes > RECORD_BYTES_MAX as u64 {
        return Err(Damage::Limit(FileLimit::Chunk(header.unpacked_bytes)));
    }
    // One more, to see that there are not more.
    decompress(header.compression, packed, header.unpacked_bytes + 1, records)?;
    if records.len() as u64 != header.unpacked_bytes || (header.sum != 0 && header.sum != crc32fast::hash(records)) {
        return Err(Damage::ChunkSum);
    }
    Ok(())
}

/// Whether it is a chunk beyond doubt: unpacked, its records have the sum that stands in it.
pub(crate) fn is_proven(body: &[u8], records: &mut Vec<u8>) -> bool {
    split(body).is_some_and(|(header, _)| header.sum != 0) && unpack(body, records).is_ok()
}

/// Unpacks what there is of a chunk that the file's end cuts off. No sum says that it is right.
pub(crate) fn unpack_cut(body: &[u8], records: &mut Vec<u8>) {
    records.clear();
    if let Some((header, packed)) = split(body) {
        let most = header.unpacked_bytes.min(RECORD_BYTES_MAX as u64);
        // That it ends too early is known.
        let _ = decompress(header.compression, packed, most, records);
    }
}

fn decompress(compression: &[u8], packed: &[u8], most: u64, records: &mut Vec<u8>) -> Result<(), Damage> {
    match compression {
        b"" => records.extend_from_slice(&packed[..packed.len().min(most as usize)]),
        b"zstd" => {
            let mut decoder = zstd::Decoder::with_buffer(packed).map_err(|_| Damage::Compression)?;
            decoder.window_log_max(WINDOW_LOG_MAX).map_err(|_| Damage::Compression)?;
            decoder.take(most).read_to_end(records).map_err(|_| Damage::Compression)?;
        }
        b"lz4" => {
            let decoder = lz4_flex::frame::FrameDecoder::new(packed);
            decoder.take(most).read_to_end(records).map_err(|_| Damage::Compression)?;
        }
        other => return Err(Damage::ForeignCompression((*String::from_utf8_lossy(other)).into())),
    }
    Ok(())
}

/// The record at a place among a chunk's: its type, its body, and where the next one is. Nothing behind the last whole
/// one.
pub(crate) fn record_at(records: &[u8], at: usize) -> Option<(u8, Range<usize>)> {
    let (&op, len) = records.get(at..at.checked_add(HEAD_BYTES)?)?.split_first()?;
    let len = usize::try_from(u64::from_le_bytes(len.try_into().ok()?)).ok()?;
    let body = at + HEAD_BYTES..(at + HEAD_BYTES).checked_add(len)?;
    (body.end <= records.len()).then_some((op, body))
}
