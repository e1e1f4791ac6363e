//! Where a file goes on behind a record with a damaged type or length.
//!
//! No checksum protects these, so each byte from there on is looked at: whether a chunk, an index of messages, metadata
//! or the end of the data begins with it. Their bodies say in a second place how long they are. What looks like one,
//! and is none, costs a damage more, and no message: chunks have sums.

use crate::error::ReadError;
use crate::format::op;
use crate::read::chunk;
use crate::read::frames::{Frames, HEAD_BYTES};

/// Read at once.
const BLOCK_BYTES: usize = 64 << 10;
/// Names of metadata are no longer.
const NAME_BYTES_MAX: usize = 256;
/// So much of a record is looked at.
const LOOK_BYTES: usize = HEAD_BYTES + 4 + NAME_BYTES_MAX + 4;
const _: () = assert!(LOOK_BYTES >= HEAD_BYTES + chunk::EXTENT_BYTES && LOOK_BYTES < BLOCK_BYTES);

/// Channel, sequence, two times.
const MESSAGE_BYTES_MIN: u64 = 22;

/// The first place from there on where a record begins. Single messages count only in files that have such outside of
/// chunks: a damaged chunk that is not compressed has many.
pub(crate) fn find(frames: &mut Frames, from: u64, has_bare_messages: bool) -> Result<Option<u64>, ReadError> {
    let (mut block, mut block_at) = (Vec::new(), from);
    loop {
        frames.bytes_at(block_at, &mut block, BLOCK_BYTES)?;
        let is_last = block.len() < BLOCK_BYTES;
        let searched = if is_last { block.len() } else { block.len() - LOOK_BYTES };
        for offset in 0..searched {
            let at = block_at + offset as u64;
            let Some(found) = Candidate::at(&block[offset..], frames.len() - at.min(frames.len())) else { continue };
            let is_one = match found {
                Candidate::Sure => true,
                Candidate::Bare(len) => has_bare_messages && begins(frames, at + len)?,
                Candidate::DataEnd(len) => begins(frames, at + len)?,
            };
            if is_one {
                return Ok(Some(at));
            }
        }
        if is_last {
            return Ok(None);
        }
        block_at += searched as u64;
    }
}

/// What seems to begin at a place. Those with a length say too little: the record behind them tells.
enum Candidate {
    Sure,
    Bare(u64),
    DataEnd(u64),
}

impl Candidate {
    fn at(bytes: &[u8], rest: u64) -> Option<Self> {
        let (op, len) = head(bytes, rest)?;
        let body = &bytes[HEAD_BYTES..];
        let number = |at: usize| Some(u64::from(u32::from_le_bytes(*body.get(at..)?.first_chunk()?)));
        match op {
            op::CHUNK => chunk::extent(body).filter(|extent| *extent <= len).map(|_| Self::Sure),
            op::MESSAGE_INDEX => chunk::is_index(body, len).then_some(Self::Sure),
            op::METADATA => {
                let name = number(0).filter(|name| *name <= NAME_BYTES_MAX as u64)?;
                number(4 + name as usize).filter(|texts| 8 + name + texts == len).map(|_| Self::Sure)
            }
            op::DATA_END => (len == 4).then_some(Self::DataEnd(HEAD_BYTES as u64 + len)),
            op::MESSAGE => (len >= MESSAGE_BYTES_MIN).then_some(Self::Bare(HEAD_BYTES as u64 + len)),
            _ => None,
        }
    }
}

/// Type and length of a record that ends before the file does.
fn head(bytes: &[u8], rest: u64) -> Option<(u8, u64)> {
    let (op, len) = bytes.first_chunk::<HEAD_BYTES>()?.split_first()?;
    let len = u64::from_le_bytes(len.try_into().ok()?);
    (len.checked_add(HEAD_BYTES as u64)? <= rest).then_some((*op, len))
}

/// Whether a record of MCAP can begin there.
fn begins(frames: &mut Frames, at: u64) -> Result<bool, ReadError> {
    let mut bytes = Vec::new();
    frames.bytes_at(at, &mut bytes, HEAD_BYTES)?;
    let rest = frames.len().saturating_sub(at);
    Ok(head(&bytes, rest).is_some_and(|(op, _)| (op::HEADER..=op::DATA_END).contains(&op)))
}
