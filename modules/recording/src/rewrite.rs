//! A new file from what others have. It gets its name once it is whole.

use crate::disk::{Disk, RealDisk, mode_of};
use crate::error::{Damage, ReadError, RewriteError};
use crate::format::{CHUNK_BYTES_MAX, MESSAGE_OVERHEAD_BYTES, is_of_others, key};
use crate::part_file::PartFile;
use crate::read::attachment::Attachment;
use crate::read::definitions::Definition;
use crate::write::file::OpenFile;
use mcap::records::{Header, MessageHeader};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Told now and then how many bytes are read, and of how many.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// A file in the making. Dropped before its end, it leaves nothing.
pub(crate) struct Rewriter {
    file: OpenFile,
    part: PartFile,
    /// Channels by source and number there.
    channels: BTreeMap<(usize, u16), u16>,
    chunk_bytes: usize,
    messages: u64,
    /// The new file says that it is of another program: what that wrote under words of ours stays.
    keeps_theirs: bool,
}

impl Rewriter {
    /// Begins one, with this header, of these sources.
    pub(crate) fn create<'a>(
        to: &Path,
        header: &Header,
        sources: impl IntoIterator<Item = &'a Path>,
    ) -> Result<Self, RewriteError> {
        let mode = mode_of(sources);
        let (part, made) = PartFile::create(to, |path| RealDisk.create(path, mode))?;
        let file = OpenFile::begin(&mut RealDisk, part.path(), made, header)?;
        let keeps_theirs = is_of_others(header);
        Ok(Self { file, part, channels: BTreeMap::new(), chunk_bytes: 0, messages: 0, keeps_theirs })
    }

    /// Whether it is of another program, as what it is made of: all that one wrote goes on meaning what it means there.
    pub(crate) fn keeps_theirs(&self) -> bool {
        self.keeps_theirs
    }

    /// Messages so far, without those that are repeated from an earlier file.
    pub(crate) fn messages(&self) -> u64 {
        self.messages
    }

    pub(crate) fn metadata(&mut self, name: &str, texts: &BTreeMap<String, String>) -> Result<(), RewriteError> {
        self.chunk_bytes = 0;
        Ok(self.file.metadata(name, texts)?)
    }

    /// Copies an attachment of this file, if it is whole.
    pub(crate) fn attachment<E: From<ReadError> + From<RewriteError>>(
        &mut self,
        path: &Path,
        attachment: Attachment,
    ) -> Result<Result<(), Damage>, E> {
        let mut parts = match attachment.open(path)? {
            Ok(parts) => parts,
            Err(damage) => return Ok(Err(damage)),
        };
        self.chunk_bytes = 0;
        self.file.begin_attachment(parts.index.clone(), parts.bytes()).map_err(RewriteError::from)?;
        while let Some(part) = parts.next()? {
            self.file.attachment_part(part).map_err(RewriteError::from)?;
        }
        Ok(Ok(()))
    }

    /// Whether it is described.
    pub(crate) fn has_channel(&self, source: usize, id: u16) -> bool {
        self.channels.contains_key(&(source, id))
    }

    /// Describes a channel, also if no message of it comes.
    pub(crate) fn channel(&mut self, source: usize, id: u16, channel: &Arc<Definition>) -> Result<u16, RewriteError> {
        if let Some(known) = self.channels.get(&(source, id)) {
            return Ok(*known);
        }
        let Definition { topic, message_encoding, texts, unheeded, schema } = &**channel;
        let schema = match schema.encoding.as_str() {
            "" => 0,
            encoding => self.file.schema(&schema.name, encoding, &schema.data)?,
        };
        let new = if self.keeps_theirs {
            let ours = texts.iter().map(|(key, text)| match key.as_str() {
                key::REPEATED => (key::REPEATED_OF_OTHERS.to_owned(), text.clone()),
                _ => (key.clone(), text.clone()),
            });
            let texts = ours.chain(unheeded.clone()).collect();
            self.file.channel(schema, topic, message_encoding, &texts)?
        } else {
            self.file.channel(schema, topic, message_encoding, texts)?
        };
        self.channels.insert((source, id), new);
        Ok(new)
    }

    pub(crate) fn message(
        &mut self,
        source: usize,
        channel: &Arc<Definition>,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<(), RewriteError> {
        let channel_id = self.channel(source, header.channel_id, channel)?;
        let more = data.len() + MESSAGE_OVERHEAD_BYTES;
        if self.chunk_bytes > 0 && self.chunk_bytes + more > CHUNK_BYTES_MAX {
            self.file.end_chunk()?;
            self.chunk_bytes = 0;
        }
        self.file.message(&MessageHeader { channel_id, ..*header }, data)?;
        self.chunk_bytes += more;
        self.messages += u64::from(!channel.is_repeated());
        Ok(())
    }

    /// Closes it and gives it its name. Its length.
    pub(crate) fn finish(mut self) -> Result<u64, RewriteError> {
        let bytes = self.file.close(&mut RealDisk)?;
        self.part.finish()?;
        Ok(bytes)
    }
}
