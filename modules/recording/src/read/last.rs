//! The last message of a topic in a file, also in one that was not closed: a recorder that starts again goes on
//! behind it.
//!
//! The file is gone through once. Chunks are passed over: the index of messages behind each says which channels it
//! has. Unpacked are those that describe channels, the one with the last message, and the last one of a file that was
//! not closed.

use crate::error::ReadError;
use crate::format::{PROFILE, op};
use crate::read::contents::{Contents, Found, Item};
use crate::read::definitions::Definition;
use crate::read::frames::{Frames, Step};
use std::path::Path;

/// The last message of a topic.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LastMessage {
    /// Of system time.
    pub epoch: u64,
    /// When the value was taken, by its publisher.
    pub stamp_ns: u64,
    /// Its number on the channel.
    pub sequence: u32,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// The last message of a topic in one of our files, whether it was closed or not; what it repeats of earlier files does
/// not count. None if it has none, or is no file of ours.
///
/// # Errors
/// When it cannot be read, or is no MCAP file. Behind damage between its records nothing is found.
pub fn last_message(path: &Path, topic: &str) -> Result<Option<LastMessage>, ReadError> {
    let mut search = LastSearch { contents: Contents::open(path)?, topic, last_in: None };
    search.contents.read_header()?;
    if search.contents.header().is_none_or(|header| header.profile != PROFILE) {
        return Ok(None);
    }
    let last = match search.find(&mut Frames::open(path)?)? {
        Some(chunk) => search.last_from(chunk)?,
        None => None,
    };
    Ok(last.or_else(|| search.last_in_chunk()))
}

struct LastSearch<'a> {
    contents: Contents,
    topic: &'a str,
    /// The last chunk that has a message of it, and the channel.
    last_in: Option<(u64, u16)>,
}

impl LastSearch<'_> {
    /// Goes through the file. Of one that was not closed, where its last chunk begins: the index behind it may be cut
    /// off, or missing, as the chunk may be.
    fn find(&mut self, frames: &mut Frames) -> Result<Option<u64>, ReadError> {
        let (mut chunk, mut has_index) = (None, true);
        loop {
            let at = frames.at();
            match frames.step_over_chunks()? {
                Step::Record(op::CHUNK) => {
                    // One without messages has descriptions.
                    if let Some(before) = chunk.filter(|_| !has_index) {
                        self.learn(before);
                    }
                    (chunk, has_index) = (Some(at), false);
                }
                Step::Record(op::MESSAGE_INDEX) => {
                    has_index = true;
                    let id = frames.body().first_chunk().copied().map(u16::from_le_bytes);
                    id.zip(chunk).into_iter().for_each(|(id, chunk)| self.note(id, chunk));
                }
                Step::Record(op::DATA_END) => return Ok(None),
                Step::Record(_) => {}
                Step::Cut(Some(op::CHUNK)) => return Ok(Some(at)),
                Step::Cut(_) | Step::Damaged(_) | Step::End => return Ok(chunk),
            }
        }
    }

    /// A chunk has messages of this channel.
    fn note(&mut self, id: u16, chunk: u64) {
        if self.contents.definitions().channel(id).is_none() {
            self.learn(chunk);
        }
        if self.contents.definitions().channel(id).is_some_and(|channel| self.is_it(channel)) {
            self.last_in = Some((chunk, id));
        }
    }

    fn is_it(&self, channel: &Definition) -> bool {
        channel.topic == self.topic && !channel.is_repeated()
    }

    /// Reads what a chunk describes. Nobody can read messages of which the description is damaged.
    fn learn(&mut self, chunk: u64) {
        if self.contents.open_chunk(chunk).is_ok() {
            while let Ok(Some(_)) = self.contents.next_in_chunk() {}
        }
    }

    fn last_from(&mut self, at: u64) -> Result<Option<LastMessage>, ReadError> {
        self.contents.go_to(at)?;
        let mut last = None;
        while let Some(item) = self.contents.next()? {
            if let Item::Message(found) = item
                && self.is_it(&found.channel)
            {
                last = Some(self.message(&found));
            }
        }
        Ok(last)
    }

    fn last_in_chunk(&mut self) -> Option<LastMessage> {
        let (chunk, id) = self.last_in?;
        self.contents.open_chunk(chunk).ok()?;
        let mut last = None;
        while let Ok(Some(item)) = self.contents.next_in_chunk() {
            if let Item::Message(found) = item
                && found.header.channel_id == id
            {
                last = Some(found);
            }
        }
        last.map(|found| self.message(&found))
    }

    fn message(&self, found: &Found) -> LastMessage {
        LastMessage {
            epoch: found.channel.epoch().unwrap_or_default(),
            stamp_ns: found.header.publish_time,
            sequence: found.header.sequence,
            data: self.contents.data(found).to_vec(),
        }
    }
}
