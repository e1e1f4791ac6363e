//! What is in a file.

use crate::about::About;
use crate::damages::Damages;
use crate::described::DescribedModule;
use crate::error::{Damage, ReadError};
use crate::format::{key, metadata};
use crate::loss::Losses;
use crate::order::Mark;
use crate::read::contents::{Contents, Ending, Item};
use crate::read::definitions::{ChannelIdentity, Definition};
use crate::read::frames::Frames;
use crate::read::index::{Index, times_at};
use mcap::records::{AttachmentIndex, Metadata};
use rohrpost_schema::Type;
use rohrpost_schema::plain::ForeignText;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Metadata of a file: texts by their keys.
pub type ForeignTexts = BTreeMap<ForeignText, ForeignText>;

/// What is in a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Info {
    /// The file.
    pub path: PathBuf,
    /// Length of the file.
    pub bytes: u64,
    /// It has its index and its end.
    pub is_closed: bool,
    /// Why it was closed, if its writer says so: `rotated`, `ended`, `low space`.
    pub closed_because: Option<ForeignText>,
    /// Which program wrote it.
    pub library: ForeignText,
    /// Of which kind it is: `rohrpost` in our files, `ros2` in those of rosbag2.
    pub profile: ForeignText,
    /// Where it is not readable: looked for in files that were not closed. The first hundred.
    pub damages: Vec<(u64, Damage)>,
    /// All of them.
    pub damage_count: u64,
    /// Chunks.
    pub chunks: u64,
    /// Messages in all channels, without those that are repeated.
    pub messages: u64,
    /// What it begins with, repeated from an earlier file.
    pub repeated: u64,
    /// Messages that should be in it, and are not.
    pub lost: u64,
    /// When what it begins with is played, in nanoseconds of system time: also what is repeated.
    pub begins_ns: Option<u64>,
    /// Why they are not, as far as the file tells.
    pub losses: Losses,
    /// When the first message came, in nanoseconds of system time.
    pub first_ns: Option<u64>,
    /// When the last one came; not before the first.
    pub last_ns: Option<u64>,
    /// By topic.
    pub channels: Vec<ChannelInfo>,
    /// Stretches of system time between its steps.
    pub epochs: Vec<EpochInfo>,
    /// Node, versions and number of the file.
    pub session: ForeignTexts,
    /// Texts of the configuration, by file name: the last one of each name.
    pub configuration: BTreeMap<String, String>,
    /// Other texts that a name had before, as in a merged file: name and text.
    pub earlier_configuration: BTreeSet<(String, String)>,
    /// Marks that were set, in the order of the file.
    pub marks: Vec<Mark>,
    /// Files in it, as other programs put them there.
    pub attachments: Vec<AttachmentInfo>,
    /// Modules of which something is recorded, each interface of them once.
    pub described: Vec<DescribedModule>,
    /// What else the file says of itself: `rohrpost.recovered`, `rohrpost.cut`, `rohrpost.merged`, and others'.
    pub others: Vec<(ForeignText, ForeignTexts)>,
}

/// A file in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttachmentInfo {
    /// Name of the attachment.
    pub name: ForeignText,
    /// Media type of the attachment: `text/plain`.
    pub media_type: ForeignText,
    /// Length of the attachment, bytes.
    pub bytes: u64,
}

/// One topic of a file; several if it has values of several types.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelInfo {
    /// Name and item.
    pub topic: ForeignText,
    /// What published: `laser.0`; empty in files of other programs.
    pub name: ForeignText,
    /// What it published: `scan`.
    pub item: ForeignText,
    /// The name of its type.
    pub type_name: ForeignText,
    /// Its type, if it is one of ours.
    pub ty: Option<Arc<Type>>,
    /// How its type is described: `rohrpost-schema` in our files; empty: not at all.
    pub schema_encoding: ForeignText,
    /// `postcard` in our files.
    pub message_encoding: ForeignText,
    /// The topic that it was drawn of for other programs, if it was.
    pub drawn_of: Option<ForeignText>,
    /// Pictures or points were reduced as they were drawn: some of them, or all.
    pub is_reduced: bool,
    /// Messages, without those that are repeated.
    pub messages: u64,
    /// Repeated from an earlier file, as the beginning of this one.
    pub repeated: u64,
    /// Messages that should be here, and are not.
    pub lost: u64,
    /// Why they are not, as far as the file tells.
    pub losses: Losses,
    /// When the first one came.
    pub first_ns: Option<u64>,
    /// When the last one came.
    pub last_ns: Option<u64>,
}

/// A stretch of system time without a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpochInfo {
    /// Its number.
    pub epoch: u64,
    /// When the first message of it came.
    pub first_ns: Option<u64>,
    /// When the last one came.
    pub last_ns: Option<u64>,
    /// Messages with stamps of it.
    pub messages: u64,
}

impl AttachmentInfo {
    fn of(index: AttachmentIndex) -> Self {
        let AttachmentIndex { name, media_type, data_size: bytes, .. } = index;
        Self { name: name.into(), media_type: media_type.into(), bytes }
    }
}

impl Info {
    /// Name and text of each configuration that the file says it was made with.
    pub fn configurations(&self) -> impl Iterator<Item = (&str, &str)> {
        let earlier = self.earlier_configuration.iter().map(|(name, text)| (name, text));
        earlier.chain(&self.configuration).map(|(name, text)| (name.as_str(), text.as_str()))
    }

    /// Each file that was merged says its own; mostly they are the same.
    fn add_configuration(&mut self, texts: BTreeMap<String, String>) {
        for (name, text) in texts {
            if let Some(before) = self.configuration.insert(name.clone(), text.clone())
                && before != text
            {
                self.earlier_configuration.insert((name, before));
            }
        }
    }
}

/// Reads the index of a closed file; all of a file that is not, or that has no index of its messages, as others write.
///
/// # Errors
/// When it is no MCAP file, or its index is damaged.
pub fn info(path: &Path) -> Result<Info, ReadError> {
    let mut frames = Frames::open(path)?;
    match Index::read(&mut frames) {
        Ok(index) if index.knows_all_channels() && index.knows_times() && index.lists_what_is_no_message() => {
            from_index(frames, index)
        }
        Ok(_) | Err(ReadError::NotClosed { .. }) => from_all(path),
        Err(error) => Err(error),
    }
}

/// What is counted of each channel.
#[derive(Default)]
struct Tally {
    messages: u64,
    times: Option<(u64, u64)>,
}

impl Tally {
    fn widen(&mut self, times: Option<(u64, u64)>) {
        self.times = wider(self.times, times);
    }
}

fn wider(one: Option<(u64, u64)>, other: Option<(u64, u64)>) -> Option<(u64, u64)> {
    match (one, other) {
        (Some((first, last)), Some((other_first, other_last))) => Some((first.min(other_first), last.max(other_last))),
        (one, other) => one.or(other),
    }
}

fn from_index(mut frames: Frames, index: Index) -> Result<Info, ReadError> {
    let Index { definitions, chunks, metadata, attachments, statistics, .. } = index;
    let statistics = statistics.unwrap_or_default();
    let counts = &statistics.channel_message_counts;
    let mut tallies: BTreeMap<u16, Tally> =
        counts.iter().map(|(id, messages)| (*id, Tally { messages: *messages, times: None })).collect();
    // The first chunk of each channel has its first message, the last one its last; in between only a step of time
    // reaches further, which the file's own times show.
    let mut ends: BTreeMap<u16, (u64, u64)> = BTreeMap::new();
    for (id, at) in chunks.iter().flat_map(|chunk| &chunk.message_index_offsets) {
        ends.entry(*id).or_insert((*at, *at)).1 = *at;
    }
    for (id, (first, last)) in ends {
        let tally = tallies.entry(id).or_default();
        tally.widen(times_at(&mut frames, first)?);
        tally.widen(times_at(&mut frames, last)?);
    }
    let mut contents = Contents::new(frames, definitions);
    let mut about = About::default();
    for at in metadata {
        let its = contents.metadata_at(at.offset)?;
        about.add(&contents, its)?;
    }
    about.attachments = attachments;
    contents.read_header()?;
    let mut info = build(&contents, &tallies, about)?;
    info.is_closed = true;
    info.chunks = chunks.len() as u64;
    if info.messages > 0 {
        info.first_ns = Some(statistics.message_start_time);
        info.begins_ns = info.first_ns;
        info.last_ns = Some(statistics.message_end_time);
    }
    Ok(info)
}

fn from_all(path: &Path) -> Result<Info, ReadError> {
    let mut contents = Contents::open(path)?;
    let mut tallies: BTreeMap<u16, Tally> = BTreeMap::new();
    let (mut about, mut damages) = (About::default(), Damages::default());
    while let Some(item) = contents.next()? {
        match item {
            Item::Message(found) => {
                let tally = tallies.entry(found.header.channel_id).or_default();
                tally.messages += 1;
                tally.widen(Some((found.header.log_time, found.header.log_time)));
            }
            Item::Metadata(metadata) => about.add(&contents, metadata)?,
            Item::Attachment(attachment) => about.attachments.push(attachment.index),
            Item::Damaged(at, damage) => damages.note(at, damage),
        }
    }
    let mut info = build(&contents, &tallies, about)?;
    info.is_closed = contents.ending() == Some(Ending::Closed);
    info.chunks = contents.chunks();
    (info.damages, info.damage_count) = (damages.listed, damages.count);
    Ok(info)
}

fn build(contents: &Contents, tallies: &BTreeMap<u16, Tally>, about: About) -> Result<Info, ReadError> {
    let definitions = contents.definitions();
    let mut info = Info {
        path: contents.path().to_owned(),
        bytes: contents.file_bytes(),
        library: contents.header().map(|header| header.library.as_str().into()).unwrap_or_default(),
        profile: contents.header().map(|header| header.profile.as_str().into()).unwrap_or_default(),
        attachments: about.attachments.into_iter().map(AttachmentInfo::of).collect(),
        ..Info::default()
    };
    let About { lost, losses, .. } = about;
    let mut memory = about.memory.and(definitions.memory()).map_err(|limit| contents.too_much(limit))?;
    for its in about.metadata {
        let is_heeded = contents.heeds(&its);
        let Metadata { name, metadata: mut texts } = its;
        match name.as_str() {
            _ if !is_heeded => info.others.push((name.into(), foreign(texts))),
            metadata::SESSION if info.session.is_empty() => info.session = foreign(texts),
            metadata::CONFIGURATION => info.add_configuration(texts),
            metadata::CLOSED => info.closed_because = texts.remove("reason").map(ForeignText::from),
            // Epochs are told by the channels.
            metadata::EPOCH => {}
            metadata::MARK if let Some(mark) = Mark::of_texts(&texts) => info.marks.push(mark),
            metadata::DESCRIPTION => match DescribedModule::read(&texts) {
                Some(module) if info.described.contains(&module) => {}
                Some(module) => {
                    memory.add(0, module.description.memory_bytes()).map_err(|limit| contents.too_much(limit))?;
                    info.described.push(module);
                }
                None => info.others.push((name.into(), foreign(texts))),
            },
            _ => info.others.push((name.into(), foreign(texts))),
        }
    }
    let mut channels: Vec<ChannelInfo> = Vec::new();
    let mut places: BTreeMap<ChannelIdentity<'_>, usize> = BTreeMap::new();
    let mut epochs: BTreeMap<u64, Tally> = BTreeMap::new();
    let (mut times, mut all_times) = (None, None);
    for (id, channel) in definitions.channels() {
        let tally = tallies.get(&id);
        let (messages, its_times) = tally.map_or((0, None), |tally| (tally.messages, tally.times));
        let place = *places.entry(channel.identity()).or_insert(channels.len());
        if place == channels.len() {
            channels.push(ChannelInfo::default());
        }
        let told = &mut channels[place];
        describe(told, channel);
        all_times = wider(all_times, its_times);
        if channel.is_repeated() {
            told.repeated = told.repeated.saturating_add(messages);
            continue;
        }
        told.messages = told.messages.saturating_add(messages);
        (told.first_ns, told.last_ns) = wider(told.first_ns.zip(told.last_ns), its_times).unzip();
        times = wider(times, its_times);
        if let Some(epoch) = channel.epoch().filter(|_| messages > 0) {
            let tally = epochs.entry(epoch).or_default();
            tally.messages = tally.messages.saturating_add(messages);
            tally.widen(its_times);
        }
    }
    // Those of one topic stay in the order of the file.
    channels.sort_by(|one, other| one.topic.cmp(&other.topic));
    for (topic, count) in &lost {
        let at = channels.partition_point(|channel| *channel.topic < **topic);
        if channels.get(at).is_none_or(|channel| *channel.topic != **topic) {
            channels.insert(at, ChannelInfo { topic: topic.as_str().into(), ..ChannelInfo::default() });
        }
        channels[at].lost = *count;
        channels[at].losses = losses.get(topic).copied().unwrap_or_default();
        info.losses += channels[at].losses;
    }
    (info.first_ns, info.last_ns) = times.unzip();
    info.begins_ns = all_times.map(|(first_ns, _)| first_ns);
    info.lost = sum(lost.values().copied());
    info.channels = channels;
    info.messages = sum(info.channels.iter().map(|channel| channel.messages));
    info.repeated = sum(info.channels.iter().map(|channel| channel.repeated));
    let epoch_info = |(epoch, Tally { messages, times }): (u64, Tally)| {
        let (first_ns, last_ns) = times.unzip();
        EpochInfo { epoch, first_ns, last_ns, messages }
    };
    info.epochs = epochs.into_iter().map(epoch_info).collect();
    Ok(info)
}

fn foreign(texts: BTreeMap<String, String>) -> ForeignTexts {
    texts.into_iter().map(|(key, text)| (key.into(), text.into())).collect()
}

/// Files may claim any count.
fn sum(counts: impl Iterator<Item = u64>) -> u64 {
    counts.fold(0, u64::saturating_add)
}

/// A topic has a channel for each epoch, all with the same description.
fn describe(info: &mut ChannelInfo, channel: &Definition) {
    let said = |key: &str| channel.texts.get(key).map(|text| ForeignText::from(text.as_str()));
    let text = |key: &str| said(key).unwrap_or_default();
    info.topic = channel.topic.as_str().into();
    (info.name, info.item) = (text(key::NAME), text(key::ITEM));
    info.type_name = channel.schema.name.as_str().into();
    info.ty = channel.schema.ty().cloned();
    info.schema_encoding = channel.schema.encoding.as_str().into();
    info.message_encoding = channel.message_encoding.as_str().into();
    info.drawn_of = said(key::DRAWN);
    info.is_reduced |= channel.texts.contains_key(key::REDUCED);
}
