//! Messages and metadata of a file, in its order.

mod outside;

use crate::error::{Damage, FileLimit, ReadError, Shown};
use crate::format::{is_our_word, op};
use crate::read::ahead::ReadAhead;
use crate::read::attachment::Attachment;
use crate::read::chunk;
use crate::read::definitions::{Definition, Definitions, Untaken};
use crate::read::frames::{Frames, Step};
use crate::read::index::Index;
use mcap::records::{ChunkIndex, Header, MessageHeader, Metadata, Record};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// What a message takes before its data.
const MESSAGE_HEAD_BYTES: usize = 22;

/// A file, read from its beginning or chunk by chunk.
pub(crate) struct Contents {
    frames: Frames,
    definitions: Definitions,
    header: Option<Header>,
    /// Records of the present chunk.
    records: Vec<u8>,
    /// Where among them the next one is; none outside of chunks.
    in_chunk: Option<usize>,
    /// The present chunk is cut off by the file's end.
    is_cut: bool,
    chunks: u64,
    /// Where the present record of the file begins.
    begins: u64,
    /// From here on a record is searched for if none is where the next one should be: behind the present one if it says
    /// twice how long it is, else behind its head.
    resume_at: u64,
    /// Bytes that were read again, since records did not end where they say.
    reread: u64,
    has_bare_messages: bool,
    /// Behind its data a file repeats what it describes.
    is_behind_data: bool,
    /// What is wrong with how it begins is told.
    has_told_magic: bool,
    ending: Option<Ending>,
    /// What reads on, if that is a thread.
    ahead: Option<ReadAhead>,
}

/// How a file ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// As it should.
    Closed,
    /// Behind a record, or inside of one.
    Open,
    /// Not to be read on from here.
    Damaged,
}

/// The next thing in a file.
#[derive(Debug)]
pub(crate) enum Item {
    /// A message; its data is [`Contents::data`].
    Message(Found),
    /// Of the file, not of a channel.
    Metadata(Metadata),
    /// A file in it; its bytes are still to be read.
    Attachment(Attachment),
    /// What is not readable: where its record begins, and why. Reading goes on behind it, if it can.
    Damaged(u64, Damage),
}

/// A message, and where its data is.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) header: MessageHeader,
    pub(crate) channel: Arc<Definition>,
    /// It is of a chunk that is cut off, so no sum says that it is right.
    pub(crate) is_unchecked: bool,
    data: Range<usize>,
    is_in_chunk: bool,
}

impl Found {
    pub(crate) fn is_in_chunk(&self) -> bool {
        self.is_in_chunk
    }

    /// The same with its data in another buffer, to which they are copied.
    pub(crate) fn copied(&self, bytes: &[u8], to: &mut Vec<u8>) -> Self {
        let data = to.len()..to.len() + bytes.len();
        to.extend_from_slice(bytes);
        Self { header: self.header, channel: self.channel.clone(), data, ..*self }
    }

    /// Its data in the buffer where they were copied to.
    pub(crate) fn data_in<'a>(&self, buffer: &'a [u8]) -> &'a [u8] {
        &buffer[self.data.clone()]
    }
}

impl Contents {
    /// From the first record on.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        Ok(Self::new(Frames::open(path)?, Definitions::default()))
    }

    /// With what its index says.
    pub(crate) fn new(frames: Frames, definitions: Definitions) -> Self {
        let resume_at = frames.at();
        Self {
            frames,
            definitions,
            header: None,
            records: Vec::new(),
            in_chunk: None,
            is_cut: false,
            chunks: 0,
            begins: 0,
            resume_at,
            reread: 0,
            has_bare_messages: false,
            is_behind_data: false,
            has_told_magic: false,
            ending: None,
            ahead: None,
        }
    }

    /// The same file, from the first chunk on of which the index says this; from its beginning if it has no index.
    pub(crate) fn at_first_chunk(&self, is_it: impl Fn(&ChunkIndex) -> bool) -> Result<Self, ReadError> {
        let mut frames = Frames::open(self.path())?;
        let index = match Index::read(&mut frames) {
            Ok(index) if index.knows_all_chunks() && index.describes_all_channels() => index,
            Ok(_) | Err(ReadError::NotClosed { .. }) => return Self::open(self.path()),
            Err(error) => return Err(error),
        };
        // Behind the last one there is nothing but the index.
        let behind = |chunk: &ChunkIndex| chunk.chunk_start_offset.saturating_add(chunk.chunk_length);
        let first = index.chunks.iter().find(|chunk| is_it(chunk)).map(|chunk| chunk.chunk_start_offset);
        let at = first.or_else(|| index.chunks.last().map(behind)).unwrap_or_default();
        frames.seek(at)?;
        Ok(Self::new(frames, index.definitions))
    }

    pub(crate) fn path(&self) -> &Path {
        self.frames.path()
    }

    pub(crate) fn definitions(&self) -> &Definitions {
        &self.definitions
    }

    /// Which program wrote it.
    pub(crate) fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// Whether these metadata are to be heeded: in a file of another program, those under names of ours are not.
    pub(crate) fn heeds(&self, metadata: &Metadata) -> bool {
        !(self.definitions.are_others() && is_our_word(&metadata.name))
    }

    /// The same of what the file says in its header; none if it has none that can be read.
    pub(crate) fn header_of(path: &Path) -> Result<Option<Header>, ReadError> {
        let mut contents = Self::open(path)?;
        contents.read_header()?;
        Ok(contents.header)
    }

    /// Chunks so far.
    pub(crate) fn chunks(&self) -> u64 {
        self.chunks
    }

    /// Length of the file.
    pub(crate) fn file_bytes(&self) -> u64 {
        self.frames.len()
    }

    /// Where the record of the file begins that the last thing was in.
    pub(crate) fn begins(&self) -> u64 {
        self.begins
    }

    /// Once there is no next thing.
    pub(crate) fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Where reading is.
    pub(crate) fn at(&self) -> u64 {
        self.frames.at()
    }

    /// The bytes of the message that came last.
    pub(crate) fn data(&self, found: &Found) -> &[u8] {
        let all = if found.is_in_chunk { &self.records[..] } else { self.frames.body() };
        &all[found.data.clone()]
    }

    /// As an error for what reads whole files only. What is more than is read here is no damage.
    pub(crate) fn damaged(&self, at: u64, what: Damage) -> ReadError {
        match what {
            Damage::Limit(limit) => self.too_much(limit),
            what => ReadError::Damaged { path: Shown(self.path().to_owned()), at, what },
        }
    }

    /// The next thing; none at the end.
    pub(crate) fn next(&mut self) -> Result<Option<Item>, ReadError> {
        if self.frames.has_bad_magic() && !std::mem::replace(&mut self.has_told_magic, true) {
            return Ok(Some(Item::Damaged(0, Damage::Magic)));
        }
        self.next_before(u64::MAX)
    }

    /// The next thing that begins before this end of a record; none behind that.
    pub(crate) fn next_before(&mut self, ends: u64) -> Result<Option<Item>, ReadError> {
        while self.ending.is_none() && (self.in_chunk.is_some() || self.frames.at() < ends) {
            let found = match self.in_chunk {
                Some(_) => self.next_in_chunk()?,
                None => self.next_outside()?,
            };
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// From here on a thread reads the file, until it is to be read elsewhere.
    pub(crate) fn read_ahead(&mut self) -> Result<(), ReadError> {
        if self.ahead.is_none() && self.ending.is_none() {
            let mut frames = Frames::open(self.path())?;
            frames.seek(self.frames.at())?;
            self.ahead = ReadAhead::start(frames);
        }
        Ok(())
    }

    /// Goes to the chunk there; then [`Contents::next_in_chunk`] has its messages.
    pub(crate) fn open_chunk(&mut self, at: u64) -> Result<(), ReadError> {
        self.ahead = None;
        self.frames.seek(at)?;
        self.begins = at;
        match self.frames.step()? {
            Step::Record(op::CHUNK) => {
                chunk::unpack(self.frames.body(), &mut self.records).map_err(|what| self.damaged(at, what))?;
                self.in_chunk = Some(0);
                Ok(())
            }
            Step::Damaged(what) => Err(self.damaged(at, what)),
            _ => Err(self.damaged(at, Damage::Record { op: op::CHUNK_INDEX })),
        }
    }

    /// Reads on from there, where a record of the file begins.
    pub(crate) fn go_to(&mut self, at: u64) -> Result<(), ReadError> {
        (self.in_chunk, self.ahead, self.resume_at) = (None, None, at);
        self.frames.seek(at)
    }

    /// The same, also once its end was reached.
    pub(crate) fn read_again(&mut self, at: u64) -> Result<(), ReadError> {
        (self.ending, self.is_cut, self.is_behind_data) = (None, false, false);
        self.go_to(at)
    }

    /// Reads which program wrote it: the first record.
    pub(crate) fn read_header(&mut self) -> Result<(), ReadError> {
        self.go_to(mcap::MAGIC.len() as u64)?;
        self.next_outside().map(drop)
    }

    /// The metadata there.
    pub(crate) fn metadata_at(&mut self, at: u64) -> Result<Metadata, ReadError> {
        self.go_to(at)?;
        match self.next_outside()? {
            Some(Item::Metadata(metadata)) => Ok(metadata),
            _ => Err(self.damaged(at, Damage::Record { op: op::METADATA_INDEX })),
        }
    }

    /// As an error of what reads any file.
    pub(crate) fn too_much(&self, limit: FileLimit) -> ReadError {
        ReadError::TooMuch { path: Shown(self.path().to_owned()), limit }
    }

    /// The next thing in the present chunk.
    pub(crate) fn next_in_chunk(&mut self) -> Result<Option<Item>, ReadError> {
        loop {
            let Some(at) = self.in_chunk else { return Ok(None) };
            let Some((op, body)) = chunk::record_at(&self.records, at) else {
                self.in_chunk = None;
                if self.is_cut {
                    self.ending = Some(Ending::Open);
                } else if at != self.records.len() {
                    return Ok(Some(Item::Damaged(self.begins, Damage::Record { op: op::CHUNK })));
                }
                return Ok(None);
            };
            self.in_chunk = Some(body.end);
            let told = match op {
                op::MESSAGE => match self.found(body, true) {
                    Ok(found) => return Ok(Some(Item::Message(found))),
                    Err(damage) => Err(damage.into()),
                },
                op::SCHEMA | op::CHANNEL => self.definitions.add(op, &self.records[body]),
                _ => Ok(()),
            };
            match told {
                Ok(()) => {}
                Err(Untaken::Damaged(damage)) => return Ok(Some(Item::Damaged(self.begins, damage))),
                Err(Untaken::TooMuch(limit)) => return Err(self.too_much(limit)),
            }
        }
    }

    fn found(&self, body: Range<usize>, is_in_chunk: bool) -> Result<Found, Damage> {
        let all = if is_in_chunk { &self.records[..] } else { self.frames.body() };
        let damaged = Damage::Record { op: op::MESSAGE };
        let Ok(Record::Message { header, data }) = mcap::parse_record(op::MESSAGE, &all[body.clone()]) else {
            return Err(damaged);
        };
        debug_assert_eq!(data.len() + MESSAGE_HEAD_BYTES, body.len(), "where the data is");
        let channel = self.definitions.channel(header.channel_id).ok_or(Damage::UnknownChannel(header.channel_id))?;
        let data = body.start + MESSAGE_HEAD_BYTES..body.end;
        Ok(Found { header, channel: channel.clone(), is_unchecked: self.is_cut, data, is_in_chunk })
    }
}
