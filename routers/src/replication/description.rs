//! Descriptions of modules on their way: in parts, from the front.

use crate::frame::{DESCRIPTION_PART_HEAD_BYTES, DescriptionPart};
use rohrpost_mailbox::StreamId;

/// Of the module that writes a stream; empty until it is known.
#[derive(Default)]
pub(super) struct OwnDescription {
    words: Vec<u8>,
    check: u32,
}

impl OwnDescription {
    pub(super) fn new(words: Vec<u8>) -> Self {
        Self { check: check(&words), words }
    }

    pub(super) fn is(&self, words: &[u8]) -> bool {
        self.words == words
    }

    pub(super) fn check(&self) -> u32 {
        self.check
    }

    /// Writes the part that begins at an offset, with what it says of the stream: place, generation, and how many
    /// records were written. Its length, and where the next part begins, if there is one.
    pub(super) fn write(
        &self,
        (place, generation, written): (u16, u16, u64),
        offset: usize,
        content: &mut [u8],
    ) -> (usize, Option<usize>) {
        let len = self.words.len();
        let end = (offset + content.len() - DESCRIPTION_PART_HEAD_BYTES).min(len);
        let (check, bytes) = (self.check, &self.words[offset..end]);
        let part = DescriptionPart { place, generation, check, len: len as u32, offset: offset as u32, written, bytes };
        let bytes = DESCRIPTION_PART_HEAD_BYTES + part.bytes.len();
        content[..DESCRIPTION_PART_HEAD_BYTES].copy_from_slice(&part.head_bytes());
        content[DESCRIPTION_PART_HEAD_BYTES..bytes].copy_from_slice(part.bytes);
        (bytes, (end < len).then_some(end))
    }
}

/// What is known of a stream by the description of its module.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct KnownOrigin {
    pub(super) check: u32,
    pub(super) id: StreamId,
}

/// What came of the description of another node's module.
#[derive(Default)]
pub(super) struct DescriptionAssembly {
    check: u32,
    len: u32,
    bytes: Vec<u8>,
}

impl DescriptionAssembly {
    /// Takes a part; the whole, once it is there. A part that is missing comes with the next round.
    pub(super) fn take(&mut self, part: &DescriptionPart<'_>) -> Option<Vec<u8>> {
        if part.offset == 0 {
            self.bytes.clear();
            (self.check, self.len) = (part.check, part.len);
        }
        let is_next = part.offset as usize == self.bytes.len() && (part.check, part.len) == (self.check, self.len);
        if !is_next {
            return None;
        }
        self.bytes.extend_from_slice(part.bytes);
        if self.bytes.len() < part.len as usize {
            return None;
        }
        let whole = std::mem::take(&mut self.bytes);
        (check(&whole) == self.check).then_some(whole)
    }
}

/// CRC-32 (of zlib) of a description.
fn check(description: &[u8]) -> u32 {
    crc32fast::hash(description)
}
