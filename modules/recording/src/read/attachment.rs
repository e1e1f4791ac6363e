//! A file in a file, as others have them: it goes to a new file as it is, in parts, however long it is.

use crate::error::{Damage, ReadError};
use crate::format::op;
use crate::read::frames::{Frames, HEAD_BYTES};
use mcap::records::AttachmentIndex;
use std::path::Path;

/// So much is in memory at once.
const PART_BYTES: usize = 64 << 10;
/// Name and media type.
const TEXT_BYTES_MAX: usize = 4 << 10;
/// Of the fields before the data.
const HEAD_BYTES_MAX: usize = 2 * size_of::<u64>() + 2 * (4 + TEXT_BYTES_MAX) + size_of::<u64>();
/// Behind the data.
const SUM_BYTES: u64 = 4;

/// An attachment of a file, and where it is there.
#[derive(Debug)]
pub(crate) struct Attachment {
    /// As the index of the file has it.
    pub(crate) index: AttachmentIndex,
    /// Where its sum is, which is of all before it.
    sum_at: u64,
}

impl Attachment {
    /// The one in the record there, which has this length; or what is wrong with it.
    pub(crate) fn at(frames: &mut Frames, begins: u64, length: u64) -> Result<Result<Self, Damage>, ReadError> {
        let damaged = Ok(Err(Damage::Record { op: op::ATTACHMENT }));
        let ends = begins.checked_add(length).filter(|ends| *ends <= frames.len());
        let (Some(ends), Some(body_bytes)) = (ends, length.checked_sub(HEAD_BYTES as u64)) else { return damaged };
        let mut bytes = Vec::new();
        frames.bytes_at(begins, &mut bytes, HEAD_BYTES + HEAD_BYTES_MAX)?;
        let head = [&[op::ATTACHMENT][..], &body_bytes.to_le_bytes()].concat();
        let Some((index, data_at)) = bytes.strip_prefix(&*head).and_then(fields) else { return damaged };
        let sum_at = (begins + (HEAD_BYTES + data_at) as u64).checked_add(index.data_size);
        // Others may write more behind the sum.
        let is_whole = |at: &u64| at.checked_add(SUM_BYTES).is_some_and(|end| end <= ends);
        let Some(sum_at) = sum_at.filter(is_whole) else { return damaged };
        let index = AttachmentIndex { offset: begins, length, ..index };
        Ok(Ok(Self { index, sum_at }))
    }

    /// Opens its file for its bytes, if its sum is right.
    pub(crate) fn open(self, path: &Path) -> Result<Result<AttachmentParts, Damage>, ReadError> {
        let frames = Frames::open(path)?;
        let at = self.index.offset + HEAD_BYTES as u64;
        let mut parts = AttachmentParts { frames, at, ends: self.sum_at, part: Vec::new(), index: self.index };
        let mut sum = crc32fast::Hasher::new();
        while let Some(part) = parts.next()? {
            sum.update(part);
        }
        parts.ends = self.sum_at + SUM_BYTES;
        let told = parts.next()?.and_then(<[u8]>::first_chunk).map_or(0, |bytes| u32::from_le_bytes(*bytes));
        parts.at = at;
        Ok(if told == 0 || told == sum.finalize() { Ok(parts) } else { Err(Damage::AttachmentSum) })
    }
}

/// The bytes of an attachment's record behind its head, part by part.
pub(crate) struct AttachmentParts {
    pub(crate) index: AttachmentIndex,
    frames: Frames,
    at: u64,
    ends: u64,
    part: Vec<u8>,
}

impl AttachmentParts {
    /// How many are left.
    pub(crate) fn bytes(&self) -> u64 {
        self.ends - self.at
    }

    pub(crate) fn next(&mut self) -> Result<Option<&[u8]>, ReadError> {
        let wanted = self.bytes().min(PART_BYTES as u64);
        if wanted == 0 {
            return Ok(None);
        }
        self.frames.bytes_at(self.at, &mut self.part, wanted as usize)?;
        // A file that was cut meanwhile has zeroes there: the length is written already.
        self.part.resize(wanted as usize, 0);
        self.at += wanted;
        Ok(Some(&self.part))
    }
}

/// The fields before its data, and where that begins; where it is in the file is not among them.
fn fields(body: &[u8]) -> Option<(AttachmentIndex, usize)> {
    let mut rest = body;
    let mut take = |len: usize| {
        let (taken, behind) = rest.split_at_checked(len)?;
        rest = behind;
        Some(taken)
    };
    let mut number = || Some(u64::from_le_bytes(take(8)?.try_into().ok()?));
    let (log_time, create_time) = (number()?, number()?);
    let mut text = || {
        let len = u32::from_le_bytes(take(4)?.try_into().ok()?) as usize;
        (len <= TEXT_BYTES_MAX).then(|| take(len).map(|text| String::from_utf8_lossy(text).into_owned()))?
    };
    let (name, media_type) = (text()?, text()?);
    let data_size = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let data_at = body.len() - rest.len();
    Some((AttachmentIndex { offset: 0, length: 0, log_time, create_time, data_size, name, media_type }, data_at))
}
