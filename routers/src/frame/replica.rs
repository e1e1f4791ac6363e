//! Parts of what a replica needs: of records, and of the description of the module that writes them. What a node asks
//! for again says [`PartRequest`](super::PartRequest).

use super::fields::{BadFrame, half, long, word};
use super::part_request::PartRequestBytes;
use rohrpost_network::RECORD_PART_HEAD_BYTES;

/// Bytes between the head of the datagram and a description's bytes.
pub const DESCRIPTION_PART_HEAD_BYTES: usize = 24;
/// Longest description that is carried.
pub const DESCRIPTION_BYTES_MAX: usize = 64 << 10;

/// What a node sends to those that have a replica of a stream, and they to it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReplicaFrame<'a> {
    /// A part of a record.
    Record(RecordPart<'a>),
    /// A part of the description of the module that writes the stream.
    Description(DescriptionPart<'a>),
    /// A node asks for parts of a record again.
    Request(PartRequestBytes<'a>),
}

impl ReplicaFrame<'_> {
    /// Place of the replica in the configuration, from 0.
    pub fn place(&self) -> u16 {
        match self {
            Self::Record(part) => part.place,
            Self::Description(part) => part.place,
            Self::Request(request) => request.place(),
        }
    }
}

/// A part of a record; all but the last have one size, which both ends know.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct RecordPart<'a> {
    /// Place of the replica in the configuration, from 0.
    pub place: u16,
    /// Counts how often the sending router has seen the stream made anew, modulo 2^16.
    pub generation: u16,
    /// Check of the description by which the record is read.
    pub description: u32,
    /// Incarnation of the record's writer.
    pub incarnation: u32,
    /// Bytes of the whole record.
    pub len: u32,
    /// Offset of these bytes in it.
    pub offset: u32,
    /// The record's number in its stream.
    pub sequence: u64,
    /// Epoch of its stamp.
    pub epoch: u64,
    /// Its stamp, ns.
    pub stamp_ns: u64,
    /// When it was written, system time of that epoch, ns; 0: nobody knows.
    pub written_ns: u64,
    /// How far off that is at most, ns, without half of the round trip by which that clock was measured.
    pub error_ns: u32,
    /// How many sequences it is behind the record that was sent to the same node before; 0: none was, or this part is
    /// sent again.
    pub step: u32,
    /// Records that the sampling of this replica has left out for this node before the record, since the sending router
    /// began, modulo 2^32. A sum, so that it stays exact over records that are lost.
    pub sampled: u32,
    /// Content of the part.
    pub bytes: &'a [u8],
}

impl<'a> RecordPart<'a> {
    /// Its head, to go before the bytes.
    pub fn head_bytes(&self) -> [u8; RECORD_PART_HEAD_BYTES] {
        let mut bytes = [0; RECORD_PART_HEAD_BYTES];
        bytes[0..2].copy_from_slice(&self.place.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.generation.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.description.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.incarnation.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.len.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.offset.to_le_bytes());
        bytes[20..28].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[28..36].copy_from_slice(&self.epoch.to_le_bytes());
        bytes[36..44].copy_from_slice(&self.stamp_ns.to_le_bytes());
        bytes[44..52].copy_from_slice(&self.written_ns.to_le_bytes());
        bytes[52..56].copy_from_slice(&self.error_ns.to_le_bytes());
        bytes[56..60].copy_from_slice(&self.step.to_le_bytes());
        bytes[60..64].copy_from_slice(&self.sampled.to_le_bytes());
        bytes
    }

    pub(crate) fn parse(rest: &'a [u8]) -> Result<Self, BadFrame> {
        let Some((b, bytes)) = rest.split_first_chunk::<RECORD_PART_HEAD_BYTES>() else {
            return Err(BadFrame::Damaged("a part of a record is cut short"));
        };
        let part = Self {
            place: half(b, 0),
            generation: half(b, 2),
            description: word(b, 4),
            incarnation: word(b, 8),
            len: word(b, 12),
            offset: word(b, 16),
            sequence: long(b, 20),
            epoch: long(b, 28),
            stamp_ns: long(b, 36),
            written_ns: long(b, 44),
            error_ns: word(b, 52),
            step: word(b, 56),
            sampled: word(b, 60),
            bytes,
        };
        let is_some = !bytes.is_empty() || part.len == 0;
        if is_some && lies_inside(part.offset, bytes, part.len) {
            Ok(part)
        } else {
            Err(BadFrame::Damaged("a part lies outside its record"))
        }
    }
}

/// A part of a description.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DescriptionPart<'a> {
    /// Place of the replica in the configuration, from 0.
    pub place: u16,
    /// As in [`RecordPart`].
    pub generation: u16,
    /// CRC-32 (of zlib) over the whole description.
    pub check: u32,
    /// Bytes of the whole.
    pub len: u32,
    /// Offset of these bytes in it.
    pub offset: u32,
    /// Records that were ever written to the stream: the sequence of the next one.
    pub written: u64,
    /// Content of the part.
    pub bytes: &'a [u8],
}

impl<'a> DescriptionPart<'a> {
    /// Its head, to go before the bytes.
    pub fn head_bytes(&self) -> [u8; DESCRIPTION_PART_HEAD_BYTES] {
        let mut bytes = [0; DESCRIPTION_PART_HEAD_BYTES];
        bytes[0..2].copy_from_slice(&self.place.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.generation.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.check.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.len.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.offset.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.written.to_le_bytes());
        bytes
    }

    pub(crate) fn parse(rest: &'a [u8]) -> Result<Self, BadFrame> {
        let Some((b, bytes)) = rest.split_first_chunk::<DESCRIPTION_PART_HEAD_BYTES>() else {
            return Err(BadFrame::Damaged("a part of a description is cut short"));
        };
        let (len, offset) = (word(b, 8), word(b, 12));
        let part = Self {
            place: half(b, 0),
            generation: half(b, 2),
            check: word(b, 4),
            len,
            offset,
            written: long(b, 16),
            bytes,
        };
        let is_whole_possible = len as usize <= DESCRIPTION_BYTES_MAX && !bytes.is_empty();
        if is_whole_possible && lies_inside(offset, bytes, len) {
            Ok(part)
        } else {
            Err(BadFrame::Damaged("a part lies outside its description"))
        }
    }
}

fn lies_inside(offset: u32, bytes: &[u8], len: u32) -> bool {
    (offset as usize).checked_add(bytes.len()).is_some_and(|end| end <= len as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Frame, FrameHead, FrameKind};

    const RECORD: RecordPart<'static> = RecordPart {
        place: 1,
        generation: 2,
        description: 3,
        incarnation: 4,
        len: 9,
        offset: 5,
        sequence: 6,
        epoch: 7,
        stamp_ns: 8,
        written_ns: 9,
        error_ns: 10,
        step: 11,
        sampled: 12,
        bytes: b"part",
    };
    const DESCRIPTION: DescriptionPart<'static> =
        DescriptionPart { place: 1, generation: 2, check: 3, len: 9, offset: 5, written: 4, bytes: b"part" };

    fn read(kind: FrameKind, rest: &[u8]) -> Result<String, BadFrame> {
        let head = FrameHead { kind, system: 1, from: 2, to: 3, digest: 4, incarnation: 5, sequence: 6 };
        let datagram = [&head.to_bytes(&[rest])[..], rest].concat();
        Frame::parse(&datagram).map(|(_, frame)| format!("{frame:?}"))
    }

    fn read_record(part: &RecordPart<'_>) -> Result<String, BadFrame> {
        read(FrameKind::RecordPart, &[&part.head_bytes()[..], part.bytes].concat())
    }

    fn read_description(part: &DescriptionPart<'_>) -> Result<String, BadFrame> {
        read(FrameKind::Description, &[&part.head_bytes()[..], part.bytes].concat())
    }

    #[test]
    fn what_is_written_reads_back() {
        let record = format!("{:?}", Frame::Replica(ReplicaFrame::Record(RECORD)));
        assert_eq!(read_record(&RECORD), Ok(record));
        let description = format!("{:?}", Frame::Replica(ReplicaFrame::Description(DESCRIPTION)));
        assert_eq!(read_description(&DESCRIPTION), Ok(description));
        assert!(read_record(&RecordPart { len: 0, offset: 0, bytes: b"", ..RECORD }).is_ok(), "a record of no bytes");
    }

    #[test]
    fn what_lies_outside_is_damaged() {
        for (len, offset, bytes) in [(9, 6, &b"part"[..]), (3, 0, b"part"), (9, u32::MAX, b"part"), (9, 5, b"")] {
            assert!(read_record(&RecordPart { len, offset, bytes, ..RECORD }).is_err(), "{len} {offset}");
            assert!(read_description(&DescriptionPart { len, offset, bytes, ..DESCRIPTION }).is_err());
        }
        let len = DESCRIPTION_BYTES_MAX as u32 + 1;
        assert!(read_description(&DescriptionPart { len, ..DESCRIPTION }).is_err(), "longer than any");
        for (kind, bytes) in
            [(FrameKind::RecordPart, RECORD_PART_HEAD_BYTES), (FrameKind::Description, DESCRIPTION_PART_HEAD_BYTES)]
        {
            for short in 0..bytes {
                assert!(read(kind, &vec![0; short]).is_err(), "{kind:?} of {short} bytes");
            }
        }
    }
}
