//! The messages of a file that a selection takes, in the file's order.

use crate::error::{Damage, ReadError, Shown};
use crate::format::metadata;
use crate::order::Mark;
use crate::read::attachment::Attachment;
use crate::read::contents::{Contents, Ending, Found, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::outline::Outline;
use crate::selection::{SelectError, Selection};
use crate::shape::Shape;
use mcap::records::{ChunkIndex, Metadata};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::vec;

/// A closed file, of which a part is read.
pub(crate) struct Selected {
    contents: Contents,
    selection: Selection,
    /// Channels that are wanted.
    channels: BTreeMap<u16, WantedChannel>,
    /// Where metadata is.
    metadata: Vec<u64>,
    attachments: Vec<Attachment>,
    way: Way,
}

/// A channel of which messages are wanted.
struct WantedChannel {
    channel: Arc<Definition>,
    /// Its messages are words, of which none is left out.
    is_each: bool,
    /// The period, counted from 1970, of the last message that was taken.
    period: Option<u64>,
}

/// How a file is read.
enum Way {
    /// The chunks that have some of it, by the index.
    Chunks(vec::IntoIter<u64>),
    /// All of it: files of others may have no chunks, or no index of them.
    Through,
}

impl Selected {
    /// At the first message.
    pub(crate) fn open(path: &Path, selection: &Selection) -> Result<Self, SelectError> {
        selection.check_time()?;
        let mut frames = Frames::open(path)?;
        let Outline { definitions, metadata, attachments, chunks } = Outline::read(&mut frames)?;
        let all = || definitions.channels();
        selection.check_names(all().map(|(_, channel)| &**channel))?;
        let wanted = all().filter(|(_, channel)| selection.has_channel(channel));
        let channels: BTreeMap<u16, WantedChannel> =
            wanted.map(|(id, channel)| (id, WantedChannel::new(channel))).collect();
        let way = if let Some(chunks) = chunks {
            // Without an index of its messages, a chunk may have any.
            let has_some = |chunk: &&ChunkIndex| {
                let offsets = &chunk.message_index_offsets;
                selection.has_time(chunk.message_start_time, chunk.message_end_time)
                    && (offsets.is_empty() || offsets.keys().any(|id| channels.contains_key(id)))
            };
            let chunks: Vec<u64> = chunks.iter().filter(has_some).map(|its| its.chunk_start_offset).collect();
            Way::Chunks(chunks.into_iter())
        } else {
            frames.seek(mcap::MAGIC.len() as u64)?;
            Way::Through
        };
        let contents = Contents::new(frames, definitions);
        Ok(Self { contents, selection: selection.clone(), channels, metadata, attachments, way })
    }

    /// Channels that are wanted.
    pub(crate) fn channels(&self) -> impl Iterator<Item = (u16, &Arc<Definition>)> {
        self.channels.iter().map(|(id, wanted)| (*id, &wanted.channel))
    }

    /// Attachments of the file, once: for a new file that is made of it.
    pub(crate) fn take_attachments(&mut self) -> Vec<Attachment> {
        std::mem::take(&mut self.attachments)
    }

    /// As an error.
    pub(crate) fn damaged(&self, at: u64, what: Damage) -> ReadError {
        self.contents.damaged(at, what)
    }

    /// What the file says of itself, but for how it was closed, and for marks out of the time range: for a new file
    /// that is made of it. `keeps_theirs`: also what is not to be heeded, as another program wrote it.
    pub(crate) fn each_metadata<E: From<ReadError>>(
        &mut self,
        keeps_theirs: bool,
        mut take: impl FnMut(Metadata) -> Result<(), E>,
    ) -> Result<(), E> {
        let begin = self.contents.at();
        for at in std::mem::take(&mut self.metadata) {
            let its = self.contents.metadata_at(at)?;
            let is_taken = match its.name.as_str() {
                _ if !self.contents.heeds(&its) => keeps_theirs,
                metadata::CLOSED => false,
                metadata::MARK => {
                    Mark::of_texts(&its.metadata).is_none_or(|mark| self.selection.has_time(mark.time_ns, mark.time_ns))
                }
                _ => true,
            };
            if is_taken {
                take(its)?;
            }
        }
        Ok(self.contents.go_to(begin)?)
    }

    /// The next message; none at the end.
    pub(crate) fn next(&mut self) -> Result<Option<Found>, ReadError> {
        while let Some(item) = self.item()? {
            match item {
                Item::Message(found) if self.takes(&found) => return Ok(Some(found)),
                Item::Damaged(at, what) => return Err(self.contents.damaged(at, what)),
                Item::Message(_) | Item::Metadata(_) | Item::Attachment(_) => {}
            }
        }
        Ok(None)
    }

    /// The bytes of the message that came last.
    pub(crate) fn data(&self, found: &Found) -> &[u8] {
        self.contents.data(found)
    }

    /// Where reading is.
    pub(crate) fn at(&self) -> u64 {
        self.contents.at()
    }

    /// Length of the file.
    pub(crate) fn file_bytes(&self) -> u64 {
        self.contents.file_bytes()
    }

    fn item(&mut self) -> Result<Option<Item>, ReadError> {
        let Way::Chunks(chunks) = &mut self.way else {
            let item = self.contents.next()?;
            return match self.contents.ending() {
                Some(Ending::Open) if item.is_none() => {
                    Err(ReadError::NotClosed { path: Shown(self.contents.path().to_owned()) })
                }
                _ => Ok(item),
            };
        };
        loop {
            if let Some(item) = self.contents.next_in_chunk()? {
                return Ok(Some(item));
            }
            let Some(at) = chunks.next() else { return Ok(None) };
            self.contents.open_chunk(at)?;
        }
    }

    fn takes(&mut self, found: &Found) -> bool {
        let header = &found.header;
        let Some(wanted) = self.channels.get_mut(&header.channel_id) else { return false };
        if !self.selection.has_time(header.log_time, header.log_time) {
            return false;
        }
        let Some(period_ns) = self.selection.period_ns.filter(|_| !wanted.is_each) else { return true };
        let period = Some(header.publish_time / period_ns.max(1));
        std::mem::replace(&mut wanted.period, period) != period
    }
}

impl WantedChannel {
    fn new(channel: &Arc<Definition>) -> Self {
        let is_each = channel.schema.ty().and_then(|ty| Shape::of(ty)) == Some(Shape::Line);
        Self { channel: channel.clone(), is_each, period: None }
    }
}
