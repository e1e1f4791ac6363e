//! What came last before the time from which a file is read: a part of the file begins with it.

use crate::error::ReadError;
use crate::format::key;
use crate::newest::KEPT_BYTES_MAX;
use crate::read::contents::{Contents, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::index::{Index, last_before};
use crate::selection::Selection;
use crate::shape::Shape;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// A message from before the part.
pub(crate) struct EarlierMessage {
    /// It says that it is repeated.
    pub(crate) channel: Arc<Definition>,
    pub(crate) header: MessageHeader,
    pub(crate) data: Vec<u8>,
}

/// Where the newest message of a topic is.
struct Place {
    chunk_at: u64,
    channel_id: u16,
    log_ns: u64,
}

/// The newest message of each topic that is selected, but for its time, in the order of their arrival; also of those
/// that the file repeats itself. None if the selection or the index does not say where to look.
pub(crate) fn newest_before(path: &Path, selection: &Selection) -> Result<Vec<EarlierMessage>, ReadError> {
    let Some(from_ns) = selection.from_ns else { return Ok(Vec::new()) };
    let mut frames = Frames::open(path)?;
    let index = Index::read(&mut frames)?;
    if !index.knows_all_channels() {
        return Ok(Vec::new());
    }
    let mut places = places(&mut frames, &index, selection, from_ns)?;
    places.sort_by_key(|place| place.chunk_at);
    let mut contents = Contents::new(frames, index.definitions);
    let (mut found, mut bytes) = (Vec::new(), 0);
    for of_chunk in places.chunk_by(|one, other| one.chunk_at == other.chunk_at) {
        for message in messages_at(&mut contents, of_chunk)? {
            if bytes + message.data.len() <= KEPT_BYTES_MAX {
                bytes += message.data.len();
                found.push(message);
            }
        }
    }
    found.sort_by_key(|message| (message.channel.epoch(), message.header.log_time));
    Ok(found)
}

fn places(frames: &mut Frames, index: &Index, selection: &Selection, from_ns: u64) -> Result<Vec<Place>, ReadError> {
    let is_words = |channel: &Definition| channel.schema.ty().and_then(|ty| Shape::of(ty)) == Some(Shape::Line);
    let is_wanted = |channel: &Definition| {
        selection.has_channel(channel) && !channel.texts.contains_key(key::DRAWN) && !is_words(channel)
    };
    let wanted: BTreeMap<u16, &str> = index
        .definitions
        .channels()
        .filter(|(_, channel)| is_wanted(channel))
        .map(|(id, channel)| (id, channel.topic.as_str()))
        .collect();
    let mut places: BTreeMap<&str, Place> = BTreeMap::new();
    for chunk in index.chunks.iter().rev().filter(|chunk| chunk.message_start_time < from_ns) {
        let chunk_at = chunk.chunk_start_offset;
        for (channel_id, at) in &chunk.message_index_offsets {
            let Some(topic) = wanted.get(channel_id) else { continue };
            // A topic has a channel for each epoch, and two of them may be in this chunk.
            let known = places.get(topic);
            if known.is_some_and(|place| place.chunk_at != chunk_at) {
                continue;
            }
            if let Some(log_ns) = last_before(frames, *at, from_ns)?
                && known.is_none_or(|place| place.log_ns <= log_ns)
            {
                places.insert(topic, Place { chunk_at, channel_id: *channel_id, log_ns });
            }
        }
    }
    Ok(places.into_values().collect())
}

/// The messages at places of one chunk.
fn messages_at(contents: &mut Contents, places: &[Place]) -> Result<Vec<EarlierMessage>, ReadError> {
    let Some(first) = places.first() else { return Ok(Vec::new()) };
    contents.open_chunk(first.chunk_at)?;
    let mut found: BTreeMap<u16, EarlierMessage> = BTreeMap::new();
    while let Some(item) = contents.next_in_chunk()? {
        match item {
            Item::Message(its) => {
                let (id, log_ns) = (its.header.channel_id, its.header.log_time);
                if places.iter().any(|place| (place.channel_id, place.log_ns) == (id, log_ns)) {
                    let channel = repeated(&its.channel);
                    found
                        .insert(id, EarlierMessage { channel, header: its.header, data: contents.data(&its).to_vec() });
                }
            }
            Item::Damaged(at, what) => return Err(contents.damaged(at, what)),
            Item::Metadata(_) | Item::Attachment(_) => {}
        }
    }
    Ok(found.into_values().collect())
}

/// The same channel, for what is repeated of it.
fn repeated(channel: &Definition) -> Arc<Definition> {
    let mut channel = channel.clone();
    channel.texts.insert(key::REPEATED.into(), "true".into());
    Arc::new(channel)
}
