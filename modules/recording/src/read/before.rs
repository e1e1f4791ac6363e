//! What came last before the place from which a file is read: a part of the file, and a replay from there, begin with
//! it.

use crate::error::{Damage, ReadError};
use crate::format::key;
use crate::read::contents::{Contents, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::index::{Index, last_before};
use crate::shape::Shape;
use mcap::records::MessageHeader;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Where reading begins. Epochs before time: behind a step of time back, what was before it has later times.
#[derive(Clone, Copy)]
pub(crate) struct PartStart {
    /// Of the first message that is read. If there is none, no epoch is behind it.
    pub(crate) epoch: Option<u64>,
    /// What arrived before this is not read.
    pub(crate) from_ns: u64,
}

impl PartStart {
    /// Behind the end of a file.
    pub(crate) const END: Self = Self { epoch: None, from_ns: u64::MAX };

    /// Messages of this epoch are before it, if they arrived before this time; none, if none are.
    fn before_ns(self, epoch: u64) -> Option<u64> {
        match self.epoch.map(|first| epoch.cmp(&first)) {
            Some(Ordering::Less) => Some(u64::MAX),
            Some(Ordering::Equal) | None => Some(self.from_ns),
            Some(Ordering::Greater) => None,
        }
    }

    fn is_behind(self, channel: &Definition, log_ns: u64) -> bool {
        self.before_ns(channel.epoch().unwrap_or_default()).is_some_and(|before_ns| log_ns < before_ns)
    }
}

/// A message from before the part.
pub(crate) struct EarlierMessage {
    /// It says that it is repeated.
    pub(crate) channel: Arc<Definition>,
    pub(crate) header: MessageHeader,
    pub(crate) data: Vec<u8>,
}

/// What was found.
#[derive(Default)]
pub(crate) struct EarlierMessages {
    /// In the order of their arrival.
    pub(crate) messages: Vec<EarlierMessage>,
    /// Bytes of them.
    pub(crate) bytes: usize,
    /// The first place that was not readable: what came last may be there.
    pub(crate) unread: Option<ReadError>,
}

impl EarlierMessages {
    /// The file cannot be read.
    pub(crate) fn none(error: ReadError) -> Self {
        Self { unread: Some(error), ..Self::default() }
    }

    fn note(&mut self, error: ReadError) {
        self.unread.get_or_insert(error);
    }

    /// Takes it, if there is room.
    fn take(&mut self, message: EarlierMessage, bytes_max: usize) {
        if self.bytes + message.data.len() <= bytes_max {
            self.bytes += message.data.len();
            self.messages.push(message);
        }
    }
}

/// The newest message of each topic that is wanted from before the start, also of those that the file repeats itself;
/// not of words, and not of what is drawn. Without an index of its messages the file is read through.
pub(crate) fn newest_before(
    path: &Path,
    is_wanted: &dyn Fn(&Definition) -> bool,
    start: PartStart,
    bytes_max: usize,
) -> Result<EarlierMessages, ReadError> {
    let is_words = |channel: &Definition| channel.schema.ty().and_then(|ty| Shape::of(ty)) == Some(Shape::Line);
    let is_wanted =
        |channel: &Definition| !channel.texts.contains_key(key::DRAWN) && !is_words(channel) && is_wanted(channel);
    let mut frames = Frames::open(path)?;
    let mut found = match Index::read(&mut frames) {
        Ok(index) if index.knows_all_channels() => by_index(frames, index, &is_wanted, start, bytes_max)?,
        Ok(_) | Err(ReadError::NotClosed { .. }) => by_reading(path, &is_wanted, start, bytes_max)?,
        Err(error) => return Err(error),
    };
    found.messages.sort_by_key(|message| (message.channel.epoch(), message.header.log_time));
    Ok(found)
}

/// Where the newest message of a topic is.
struct Place {
    chunk_at: u64,
    channel_id: u16,
    /// Epoch and time of its arrival, and whether it is a message of this file: those are behind what it repeats.
    arrival: (u64, u64, bool),
}

fn by_index(
    mut frames: Frames,
    index: Index,
    is_wanted: &dyn Fn(&Definition) -> bool,
    start: PartStart,
    bytes_max: usize,
) -> Result<EarlierMessages, ReadError> {
    let mut places = places(&mut frames, &index, is_wanted, start)?;
    places.sort_by_key(|place| place.chunk_at);
    let mut contents = Contents::new(frames, index.definitions);
    let mut found = EarlierMessages::default();
    for of_chunk in places.chunk_by(|one, other| one.chunk_at == other.chunk_at) {
        match messages_at(&mut contents, of_chunk) {
            Ok(messages) => messages.into_iter().for_each(|message| found.take(message, bytes_max)),
            Err(error) => found.note(error),
        }
    }
    Ok(found)
}

fn places(
    frames: &mut Frames,
    index: &Index,
    is_wanted: &dyn Fn(&Definition) -> bool,
    start: PartStart,
) -> Result<Vec<Place>, ReadError> {
    let wanted: BTreeMap<u16, (&Definition, u64, u64)> = index
        .definitions
        .channels()
        .filter(|(_, channel)| is_wanted(channel))
        .filter_map(|(id, channel)| {
            let epoch = channel.epoch().unwrap_or_default();
            Some((id, (&**channel, epoch, start.before_ns(epoch)?)))
        })
        .collect();
    let mut places: BTreeMap<&str, Place> = BTreeMap::new();
    for chunk in index.chunks.iter().rev() {
        for (channel_id, at) in &chunk.message_index_offsets {
            let Some((channel, epoch, before_ns)) = wanted.get(channel_id) else { continue };
            let known = places.get(&*channel.topic).map(|place| place.arrival);
            let is_newer = |log_ns| known.is_none_or(|known| (*epoch, log_ns, !channel.is_repeated()) > known);
            if chunk.message_start_time >= *before_ns || !is_newer(chunk.message_end_time) {
                continue;
            }
            if let Some(log_ns) = last_before(frames, *at, *before_ns)?.filter(|log_ns| is_newer(*log_ns)) {
                let arrival = (*epoch, log_ns, !channel.is_repeated());
                let place = Place { chunk_at: chunk.chunk_start_offset, channel_id: *channel_id, arrival };
                places.insert(&channel.topic, place);
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
                if places.iter().any(|place| (place.channel_id, place.arrival.1) == (id, log_ns)) {
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

/// Reads the file: one of ours up to the start, one of others to its end, as its messages may be in any order.
fn by_reading(
    path: &Path,
    is_wanted: &dyn Fn(&Definition) -> bool,
    start: PartStart,
    bytes_max: usize,
) -> Result<EarlierMessages, ReadError> {
    let mut contents = Contents::open(path)?;
    let (mut newest, mut found) = (BTreeMap::<String, EarlierMessage>::new(), EarlierMessages::default());
    let mut bytes = 0;
    while let Some(item) = contents.next()? {
        let its = match item {
            Item::Message(its) => its,
            Item::Damaged(at, what) if what != Damage::Cut => {
                found.note(contents.damaged(at, what));
                continue;
            }
            // Nothing was there behind the end of a file that was not closed.
            Item::Damaged(..) | Item::Metadata(_) | Item::Attachment(_) => continue,
        };
        if its.header.log_time >= start.from_ns && !contents.definitions().are_others() {
            break;
        }
        if !start.is_behind(&its.channel, its.header.log_time) || !is_wanted(&its.channel) {
            continue;
        }
        let is_older = |known: &EarlierMessage| {
            (known.channel.epoch(), known.header.log_time) > (its.channel.epoch(), its.header.log_time)
        };
        if newest.get(&its.channel.topic).is_some_and(is_older) {
            continue;
        }
        let mut data = newest.remove(&its.channel.topic).map(|known| known.data).unwrap_or_default();
        bytes -= data.len();
        data.clear();
        let all = contents.data(&its);
        if bytes + all.len() <= bytes_max {
            bytes += all.len();
            data.extend_from_slice(all);
            newest.insert(its.channel.topic.clone(), EarlierMessage { channel: its.channel, header: its.header, data });
        }
    }
    for (_, message) in newest {
        let channel = repeated(&message.channel);
        found.take(EarlierMessage { channel, ..message }, bytes_max);
    }
    Ok(found)
}

/// The same channel, for what is repeated of it.
fn repeated(channel: &Definition) -> Arc<Definition> {
    let mut channel = channel.clone();
    channel.texts.insert(key::REPEATED.into(), "true".into());
    Arc::new(channel)
}
