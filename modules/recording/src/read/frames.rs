//! A file record by record, as far as it goes.

use crate::disk::open_to_read;
use crate::error::{Damage, FileLimit, ReadError, Shown};
use crate::format::{RECORD_BYTES_MAX, op};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Type and length of a record.
pub(crate) const HEAD_BYTES: usize = 9;

/// A file, read from a place on.
pub(crate) struct Frames {
    path: PathBuf,
    input: BufReader<File>,
    len: u64,
    at: u64,
    body: Vec<u8>,
    has_bad_magic: bool,
}

/// What is at a place.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// A record of this type; its bytes are [`Frames::body`].
    Record(u8),
    /// The file ends inside of a record of this type, or of its head; what there is of it is [`Frames::body`].
    Cut(Option<u8>),
    /// A record that is not to be had.
    Damaged(Damage),
    /// The file ends behind a record.
    End,
}

impl Frames {
    /// At the first record.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let failed = |error| ReadError::Io { path: Shown(path.to_owned()), error };
        let file = open_to_read(path).map_err(failed)?;
        let len = file.metadata().map_err(failed)?.len();
        let mut frames = Self {
            path: path.to_owned(),
            input: BufReader::with_capacity(64 << 10, file),
            len,
            at: 0,
            body: Vec::new(),
            has_bad_magic: false,
        };
        let got = frames.fill(mcap::MAGIC.len() as u64)?;
        let wrong = frames.body.iter().zip(mcap::MAGIC).filter(|(one, other)| one != other).count();
        frames.has_bad_magic = wrong == 1 && got == mcap::MAGIC.len() as u64;
        if wrong > 0 && !frames.has_bad_magic {
            return Err(ReadError::NotMcap { path: Shown(path.to_owned()) });
        }
        Ok(frames)
    }

    /// One byte of what it begins with is wrong: damage, rather than another kind of file.
    pub(crate) fn has_bad_magic(&self) -> bool {
        self.has_bad_magic
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file when it was opened.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Where the next record begins.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Of the last step.
    pub(crate) fn body(&self) -> &[u8] {
        &self.body
    }

    pub(crate) fn seek(&mut self, to: u64) -> Result<(), ReadError> {
        self.input.seek(SeekFrom::Start(to)).map_err(|error| self.failed(error))?;
        self.at = to;
        Ok(())
    }

    /// Exchanges the bytes of the last step for a buffer.
    pub(crate) fn swap_body(&mut self, buffer: &mut Vec<u8>) {
        std::mem::swap(&mut self.body, buffer);
    }

    /// The next record is there: what is before it was read by others.
    pub(crate) fn pass_to(&mut self, at: u64) {
        self.at = at;
    }

    /// The next record.
    pub(crate) fn step(&mut self) -> Result<Step, ReadError> {
        match self.head()? {
            Ok((op, len)) => self.record(op, len),
            Err(step) => Ok(step),
        }
    }

    /// The next record; a whole chunk is passed over, and has no bytes then.
    pub(crate) fn step_over_chunks(&mut self) -> Result<Step, ReadError> {
        let (op, len) = match self.head()? {
            Ok(head) => head,
            Err(step) => return Ok(step),
        };
        let end = self.at.checked_add(len).filter(|end| op == op::CHUNK && *end <= self.len);
        let Some(end) = end else { return self.record(op, len) };
        self.body.clear();
        // Not beyond the file's end, so it is no more than a file may have.
        self.input.seek_relative(len as i64).map_err(|error| self.failed(error))?;
        self.at = end;
        Ok(Step::Record(op))
    }

    /// Type and length of the next record; or what there is instead.
    fn head(&mut self) -> Result<Result<(u8, u64), Step>, ReadError> {
        if self.fill(HEAD_BYTES as u64)? == 0 {
            return Ok(Err(Step::End));
        }
        let Some((&op, len)) = self.body.split_first() else { return Ok(Err(Step::End)) };
        let Ok(len) = <[u8; 8]>::try_from(len).map(u64::from_le_bytes) else {
            self.body.clear();
            return Ok(Err(Step::Cut(None)));
        };
        // What has power lost often ends in zeroes.
        Ok(if op == 0 { Err(Step::Damaged(Damage::NoRecord { op, len })) } else { Ok((op, len)) })
    }

    /// The record behind its head. Attachments are passed over, and have no bytes then: they may be of any length.
    fn record(&mut self, op: u8, len: u64) -> Result<Step, ReadError> {
        let end = self.at.checked_add(len).filter(|end| *end <= self.len);
        match end {
            Some(end) if op == op::ATTACHMENT => {
                self.body.clear();
                self.seek(end)?;
                Ok(Step::Record(op))
            }
            Some(end) if len > RECORD_BYTES_MAX as u64 => {
                self.body.clear();
                self.seek(end)?;
                Ok(Step::Damaged(Damage::Limit(FileLimit::Record(len))))
            }
            None if len > RECORD_BYTES_MAX as u64 => Ok(Step::Damaged(Damage::NoRecord { op, len })),
            _ => {
                let got = self.fill(len)?;
                Ok(if got == len { Step::Record(op) } else { Step::Cut(Some(op)) })
            }
        }
    }

    /// Fills a buffer with the bytes there, as many as there are. The next step is behind them.
    pub(crate) fn bytes_at(&mut self, at: u64, buffer: &mut Vec<u8>, wanted: usize) -> Result<(), ReadError> {
        self.seek(at)?;
        self.swap_body(buffer);
        let told = self.fill(wanted as u64);
        self.swap_body(buffer);
        told.map(drop)
    }

    /// Reads so many bytes into the body, or as many as there are.
    fn fill(&mut self, wanted: u64) -> Result<u64, ReadError> {
        self.body.clear();
        let told = self.input.by_ref().take(wanted).read_to_end(&mut self.body);
        let got = told.map_err(|error| self.failed(error))? as u64;
        self.at += got;
        Ok(got)
    }

    /// The end of the file: footer and magic bytes, if it is long enough.
    pub(crate) fn tail(&mut self, bytes: u64) -> Result<Option<&[u8]>, ReadError> {
        let Some(from) = self.len.checked_sub(bytes) else { return Ok(None) };
        self.seek(from)?;
        Ok((self.fill(bytes)? == bytes).then_some(&self.body))
    }

    /// Whether the file goes on with the magic bytes, as it does at its end.
    pub(crate) fn is_at_end_magic(&mut self) -> Result<bool, ReadError> {
        self.seek(self.at)?;
        self.fill(mcap::MAGIC.len() as u64)?;
        Ok(self.body == mcap::MAGIC)
    }

    fn failed(&self, error: io::Error) -> ReadError {
        ReadError::Io { path: Shown(self.path.clone()), error }
    }
}
