//! One MCAP file that is being written: chunks go to it whole, and what fails is taken back to the last whole one.
//!
//! A channel and its type are described in the first two chunks that use them, so that a damaged one leaves a copy.
//! Then again whenever the file has grown by [`GROWTH`] times their bytes, so that what is behind a large damage can be
//! read, and a file of whatever definitions grows by a few hundredths at most.

use super::chunk::OpenChunk;
use super::output::Output;
use super::records;
use super::summary::{DefinitionRecords, Summary};
use crate::disk::{Disk, DiskFile};
use crate::error::{DiskError, Shown};
use crate::format::{op, our_header};
use mcap::records::{AttachmentIndex, Header, MessageHeader, MetadataIndex};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A definition is repeated once the file has grown by so many times its length.
const GROWTH: u64 = 32;
/// And always in so many chunks.
const COPIES_MIN: u32 = 2;

/// A file that is written.
pub(crate) struct OpenFile {
    path: PathBuf,
    output: Output,
    chunk: OpenChunk,
    /// The number of the present chunk.
    chunk_number: u64,
    schemas: Numbered,
    channels: Numbered,
    /// The schema of each channel; 0: none.
    schema_of: Vec<u16>,
    summary: Summary,
    /// For what is put together before it is compared or written.
    scratch: Vec<u8>,
    /// Up to here all records are whole.
    whole_bytes: u64,
    has_synced_name: bool,
}

/// Schemas, or channels: the first one has number 1.
#[derive(Default)]
struct Numbered {
    numbers: HashMap<Arc<[u8]>, u16>,
    all: Vec<Copies>,
}

/// A definition, and where it is in the file.
struct Copies {
    /// Body of the definition's record behind the number.
    rest: Arc<[u8]>,
    /// In so many chunks.
    count: u32,
    /// In which chunk last, and how long the file was then.
    last_chunk: u64,
    last_at: u64,
}

impl Numbered {
    /// The number of this one, and whether it is new.
    fn number(&mut self, rest: &[u8]) -> io::Result<(u16, bool)> {
        if let Some(number) = self.numbers.get(rest) {
            return Ok((*number, false));
        }
        let too_many = || io::Error::other("a file has at most 65535 channels, and as many types");
        let number = u16::try_from(self.all.len() + 1).map_err(|_| too_many())?;
        let rest: Arc<[u8]> = rest.into();
        self.numbers.insert(rest.clone(), number);
        self.all.push(Copies { rest, count: 0, last_chunk: 0, last_at: 0 });
        Ok((number, true))
    }

    fn get(&mut self, number: u16) -> Option<&mut Copies> {
        self.all.get_mut(usize::from(number).checked_sub(1)?)
    }

    /// Their records, for the summary.
    fn records(&self, op: u8) -> DefinitionRecords {
        let mut records = DefinitionRecords::default();
        (1..).zip(&self.all).for_each(|(number, its)| records.add(op, number, &its.rest));
        records
    }
}

impl Copies {
    /// Whether it is to be repeated in this chunk.
    fn is_due(&self, chunk: u64, at: u64) -> bool {
        let grown = at.saturating_sub(self.last_at);
        self.last_chunk != chunk && (self.count < COPIES_MIN || grown >= GROWTH * self.rest.len() as u64)
    }

    fn is_in(&mut self, chunk: u64, at: u64) {
        self.count += 1;
        (self.last_chunk, self.last_at) = (chunk, at);
    }
}

impl OpenFile {
    /// Makes a new one.
    pub(crate) fn create(disk: &mut dyn Disk, path: &Path, mode: u32) -> Result<Self, DiskError> {
        let file = disk.create(path, mode).map_err(|error| DiskError::new("make the file", path, error))?;
        Self::begin(disk, path, file, &our_header())
    }

    /// Begins a file that was just made there.
    pub(crate) fn begin(
        disk: &mut dyn Disk,
        path: &Path,
        file: Box<dyn DiskFile>,
        header: &Header,
    ) -> Result<Self, DiskError> {
        let mut output = Output::new(file);
        let mut first = mcap::MAGIC.to_vec();
        records::put(&mut first, op::HEADER, |body| {
            body.text(&header.profile).text(&header.library);
        });
        let begun = output.put(&first).and_then(|()| OpenChunk::new());
        let chunk = begun.map_err(|error| {
            // Nothing is in it.
            let _ = disk.remove(path);
            DiskError::new("write", path, error)
        })?;
        Ok(Self {
            path: path.to_owned(),
            output,
            chunk,
            chunk_number: 1,
            schemas: Numbered::default(),
            channels: Numbered::default(),
            schema_of: Vec::new(),
            summary: Summary::default(),
            scratch: Vec::new(),
            whole_bytes: 0,
            has_synced_name: false,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Length so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.output.position()
    }

    /// Adds a record of metadata, behind the present chunk.
    pub(crate) fn metadata(&mut self, name: &str, texts: &BTreeMap<String, String>) -> Result<(), DiskError> {
        self.finish_chunk()?;
        let offset = self.bytes();
        self.scratch.clear();
        records::put(&mut self.scratch, op::METADATA, |body| {
            body.text(name).texts(texts);
        });
        self.explained(|its| its.output.put(&its.scratch))?;
        let length = self.scratch.len() as u64;
        self.summary.metadata.push(MetadataIndex { offset, length, name: name.to_owned() });
        Ok(())
    }

    /// Begins an attachment, behind the present chunk. The body of its record comes in parts, and is so long in all.
    /// Where it is in this file is filled in here.
    pub(crate) fn begin_attachment(&mut self, index: AttachmentIndex, body_bytes: u64) -> Result<(), DiskError> {
        self.finish_chunk()?;
        let head = [&[op::ATTACHMENT][..], &body_bytes.to_le_bytes()].concat();
        let (offset, length) = (self.bytes(), head.len() as u64 + body_bytes);
        self.summary.attachments.push(AttachmentIndex { offset, length, ..index });
        self.attachment_part(&head)
    }

    /// Goes on with it.
    pub(crate) fn attachment_part(&mut self, part: &[u8]) -> Result<(), DiskError> {
        self.explained(|its| its.output.put(part))
    }

    /// Describes a type; the same one again has the same number.
    pub(crate) fn schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> Result<u16, DiskError> {
        records::body(&mut self.scratch, |body| {
            body.text(name).text(encoding).bytes(data);
        });
        let (number, is_new) = self.explained(|its| its.schemas.number(&its.scratch))?;
        if is_new {
            self.describe_schema(number);
        }
        Ok(number)
    }

    /// Describes a channel; the same one again has the same number.
    pub(crate) fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        texts: &BTreeMap<String, String>,
    ) -> Result<u16, DiskError> {
        records::body(&mut self.scratch, |body| {
            body.u16(schema).text(topic).text(encoding).texts(texts);
        });
        let (number, is_new) = self.explained(|its| its.channels.number(&its.scratch))?;
        if is_new {
            self.schema_of.push(schema);
            self.describe_channel(number);
        }
        Ok(number)
    }

    /// Adds a message to the present chunk.
    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), DiskError> {
        self.describe_channel(header.channel_id);
        self.summary.count(header);
        self.chunk.message(header, data);
        Ok(())
    }

    /// Puts a channel into the present chunk, if that is to have it.
    fn describe_channel(&mut self, number: u16) {
        let (chunk, at) = (self.chunk_number, self.bytes());
        if !self.channels.get(number).is_some_and(|its| its.is_due(chunk, at)) {
            return;
        }
        if let Some(schema) = usize::from(number).checked_sub(1).and_then(|at| self.schema_of.get(at)) {
            self.describe_schema(*schema);
        }
        if let Some(its) = self.channels.get(number) {
            its.is_in(chunk, at);
            self.chunk.define(op::CHANNEL, number, &its.rest);
        }
    }

    /// Puts a type into the present chunk, if that is to have it. A type may be larger than its channels, and is due
    /// less often than all of them together.
    fn describe_schema(&mut self, number: u16) {
        let (chunk, at) = (self.chunk_number, self.bytes());
        if let Some(its) = self.schemas.get(number).filter(|its| its.is_due(chunk, at)) {
            its.is_in(chunk, at);
            self.chunk.define(op::SCHEMA, number, &its.rest);
        }
    }

    /// Compresses the present chunk and writes it: a killed process loses nothing before here.
    pub(crate) fn end_chunk(&mut self) -> Result<(), DiskError> {
        self.split_chunk()?;
        self.whole_bytes = self.bytes();
        Ok(())
    }

    /// Begins another chunk in the middle of what belongs together: after an error none of it stays.
    pub(crate) fn split_chunk(&mut self) -> Result<(), DiskError> {
        self.finish_chunk()?;
        self.explained(|its| its.output.flush())
    }

    fn finish_chunk(&mut self) -> Result<(), DiskError> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let at = self.bytes();
        let packed = self.explained(|its| {
            let packed = its.chunk.take()?;
            its.output.put(&packed.bytes)?;
            Ok(packed)
        })?;
        self.summary.chunk(at, &packed);
        self.chunk_number += 1;
        Ok(())
    }

    /// Has the disk keep what was written: a loss of power loses nothing before here.
    pub(crate) fn sync(&mut self, disk: &mut dyn Disk) -> Result<(), DiskError> {
        let failed = |error: io::Error| DiskError::Sync { path: Shown(self.path.clone()), error: error.into() };
        let file = self.output.file();
        file.sync().map_err(failed)?;
        if !file.has_name().map_err(failed)? {
            return Err(DiskError::Gone { path: Shown(self.path.clone()), error: None });
        }
        if !self.has_synced_name {
            disk.sync_folder(folder_of(&self.path)).map_err(failed)?;
            self.has_synced_name = true;
        }
        Ok(())
    }

    /// Writes index, statistics and end, and syncs; its length. Nothing is written behind that.
    pub(crate) fn close(&mut self, disk: &mut dyn Disk) -> Result<u64, DiskError> {
        self.finish_chunk()?;
        let mut end = Vec::new();
        records::put(&mut end, op::DATA_END, |body| {
            body.u32(self.output.sum());
        });
        let (schemas, channels) = (self.schemas.records(op::SCHEMA), self.channels.records(op::CHANNEL));
        let summary = self.summary.bytes(self.bytes() + end.len() as u64, schemas, channels);
        end.extend_from_slice(&summary);
        self.explained(|its| its.output.put(&end).and_then(|()| its.output.flush()))?;
        self.whole_bytes = self.bytes();
        self.sync(disk)?;
        Ok(self.whole_bytes)
    }

    /// Gives it up after an error: what is behind the last whole chunk is cut off. Its length then.
    ///
    /// If the disk does not do even that, messages of the last batch are in this file and in the next one.
    pub(crate) fn abandon(mut self) -> u64 {
        if self.output.file().truncate(self.whole_bytes).is_ok() { self.whole_bytes } else { self.output.position() }
    }

    /// Does what may fail as writing does.
    fn explained<T>(&mut self, act: impl FnOnce(&mut Self) -> io::Result<T>) -> Result<T, DiskError> {
        act(self).map_err(|error| DiskError::new("write", &self.path, error))
    }
}

/// Where a file is; of a bare name the present folder.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_name_is_in_the_present_folder() {
        let folders = ["part.mcap", "./part.mcap", "a/part.mcap", "/part.mcap"].map(|path| folder_of(Path::new(path)));
        assert_eq!(folders, [".", ".", "a", "/"].map(Path::new));
    }
}
