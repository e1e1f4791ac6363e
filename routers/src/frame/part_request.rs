//! A request of a node that has a replica: send these parts of a record again.

use super::fields::{BadFrame, half, long, word};

/// Bytes before the words that name the parts.
const HEAD_BYTES: usize = 24;
const WORDS_MAX: usize = 16;
/// Parts that one request can name.
pub const ASKED_PARTS_MAX: usize = 64 * WORDS_MAX;
/// Bytes of the longest request, behind the head of the datagram.
pub const PART_REQUEST_BYTES_MAX: usize = HEAD_BYTES + 8 * WORDS_MAX;

/// Asks for parts of one record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PartRequest {
    /// Place of the replica in the configuration, from 0.
    pub place: u16,
    /// As in [`RecordPart`](super::RecordPart): sequences are of that life of the stream.
    pub generation: u16,
    /// The part of the lowest bit of the first word: its index in the record.
    pub first: u32,
    /// Incarnation of the router that sent the other parts.
    pub router: u64,
    /// The record's number in its stream.
    pub sequence: u64,
    /// A bit for each part that is asked for; one at least.
    pub parts: [u64; WORDS_MAX],
}

impl PartRequest {
    /// Writes what follows the head of the datagram, without words of no bit at the end; returns its length.
    ///
    /// # Panics
    /// If there is less room than [`PART_REQUEST_BYTES_MAX`].
    pub fn write(&self, bytes: &mut [u8]) -> usize {
        bytes[0..2].copy_from_slice(&self.place.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.generation.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.first.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.router.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.sequence.to_le_bytes());
        let words = self.parts.iter().rposition(|word| *word != 0).map_or(0, |last| last + 1);
        for (into, word) in bytes[HEAD_BYTES..].chunks_exact_mut(8).zip(&self.parts[..words]) {
            into.copy_from_slice(&word.to_le_bytes());
        }
        HEAD_BYTES + 8 * words
    }

    /// The indices of the parts that it names, in order.
    pub fn asked(&self) -> impl Iterator<Item = usize> + use<> {
        let Self { first, parts, .. } = *self;
        let of_word = move |(at, mut word): (usize, u64)| {
            std::iter::from_fn(move || {
                let bit = word.trailing_zeros() as usize;
                // The lowest bit goes.
                word &= word.wrapping_sub(1);
                (bit < 64).then_some(first as usize + 64 * at + bit)
            })
        };
        parts.into_iter().enumerate().flat_map(of_word)
    }
}

/// A request as it came, in its datagram: all its claims are checked. Not read yet: few datagrams are requests, and what
/// a datagram says is handed on by value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PartRequestBytes<'a> {
    head: &'a [u8; HEAD_BYTES],
    words: &'a [[u8; 8]],
}

impl<'a> PartRequestBytes<'a> {
    pub(crate) fn parse(rest: &'a [u8]) -> Result<Self, BadFrame> {
        let Some((head, words)) = rest.split_first_chunk::<HEAD_BYTES>() else {
            return Err(BadFrame::Damaged("a request for parts is cut short"));
        };
        let (words, odd) = words.as_chunks::<8>();
        if !odd.is_empty() || words.is_empty() || words.len() > WORDS_MAX || words.last() == Some(&[0; 8]) {
            return Err(BadFrame::Damaged("a request for parts names none, or too many"));
        }
        let is_countable = word(head, 4).checked_add(ASKED_PARTS_MAX as u32).is_some();
        if is_countable {
            Ok(Self { head, words })
        } else {
            Err(BadFrame::Damaged("a request for parts that no record has"))
        }
    }

    /// Place of the replica in the configuration, from 0.
    pub fn place(&self) -> u16 {
        half(self.head, 0)
    }

    /// What it says.
    pub fn read(&self) -> PartRequest {
        let Self { head, words } = self;
        let mut parts = [0; WORDS_MAX];
        parts.iter_mut().zip(*words).for_each(|(into, word)| *into = u64::from_le_bytes(*word));
        PartRequest {
            place: self.place(),
            generation: half(head, 2),
            first: word(head, 4),
            router: long(head, 8),
            sequence: long(head, 16),
            parts,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Frame, FrameHead, FrameKind, ReplicaFrame};

    fn request(indices: &[usize]) -> PartRequest {
        let mut parts = [0; WORDS_MAX];
        indices.iter().for_each(|index| parts[index / 64] |= 1 << (index % 64));
        PartRequest { place: 1, generation: 2, first: 3000, router: 4, sequence: 5, parts }
    }

    fn read(rest: &[u8]) -> Result<PartRequest, BadFrame> {
        let kind = FrameKind::PartRequest;
        let head = FrameHead { kind, system: 1, from: 2, to: 3, digest: 4, incarnation: 5, sequence: 6 };
        let datagram = [&head.to_bytes(&[rest])[..], rest].concat();
        match Frame::parse(&datagram)?.1 {
            Frame::Replica(ReplicaFrame::Request(request)) => Ok(request.read()),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_written_reads_back_and_names_its_parts() {
        for indices in [&[0][..], &[63, 64], &[7, 500, 1023], &(0..1024).collect::<Vec<_>>()] {
            let (asks, mut bytes) = (request(indices), [0; PART_REQUEST_BYTES_MAX]);
            let len = asks.write(&mut bytes);
            assert_eq!(len, HEAD_BYTES + 8 * (indices.last().unwrap() / 64 + 1));
            assert_eq!(read(&bytes[..len]), Ok(asks));
            assert!(asks.asked().eq(indices.iter().map(|index| 3000 + index)), "{indices:?}");
        }
    }

    #[test]
    fn what_names_nothing_or_too_much_is_damaged() {
        let (mut bytes, mut long) = ([0; PART_REQUEST_BYTES_MAX], [0xff; PART_REQUEST_BYTES_MAX + 8]);
        let len = request(&[70]).write(&mut bytes);
        for short in 0..len {
            assert!(read(&bytes[..short]).is_err(), "{short} bytes");
        }
        assert!(read(&bytes[..len + 8]).is_err(), "a word of no bit at the end");
        assert!(read(&long[..]).is_err(), "one word too many");
        long[4..8].copy_from_slice(&(u32::MAX - 1023).to_le_bytes());
        assert!(read(&long[..PART_REQUEST_BYTES_MAX]).is_err(), "parts beyond all indices");
    }
}
