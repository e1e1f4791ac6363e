//! Several files in one, by time of arrival.

use crate::error::{ReadError, RewriteError, Shown};
use crate::format::{self, header_of_made, is_our_word, key, metadata};
use crate::read::contents::{Contents, Ending, Found, Item};
use crate::read::definitions::{Definition, SchemaText};
use crate::read::frames::Frames;
use crate::read::outline::Outline;
use crate::rewrite::{Progress, Rewriter};
use mcap::records::Metadata;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Why nothing was merged.
#[derive(Debug, Error)]
pub enum MergeError {
    /// One of the files.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new one.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
    /// No files.
    #[error("nothing to merge; name at least one file")]
    Nothing,
    /// Values of one name could not be read alike.
    #[error(
        "{topic} is {first_type} in {first} and {second_type} in {second}; merge files of one version, or `cut` the \
         name out of one of them"
    )]
    OtherType {
        /// Name and item.
        topic: ForeignText,
        /// A file.
        first: Shown,
        /// Its type there.
        first_type: ForeignText,
        /// Another file.
        second: Shown,
        /// Its type there.
        second_type: ForeignText,
    },
}

/// Writes messages of all files to a new one: always the one that arrived first of those that are next in their files.
/// So each file's order stays, also where its time steps back. What a file repeats at its beginning is left out if it
/// is there already; what is drawn of that, once there is anything of its topic. Its messages and bytes.
///
/// # Errors
/// When one was not closed or is damaged, one name has two types, or the new file cannot be written.
pub fn merge(paths: &[PathBuf], to: &Path, progress: &mut Progress<'_>) -> Result<(u64, u64), MergeError> {
    if paths.is_empty() {
        return Err(MergeError::Nothing);
    }
    let headers = paths.iter().map(|path| Contents::header_of(path)).collect::<Result<Vec<_>, _>>()?;
    let header = header_of_made(headers.iter().map(Option::as_ref));
    let mut new = Rewriter::create(to, &header, paths.iter().map(PathBuf::as_path))?;
    // Channels of others may have one topic and different types.
    let types = if new.keeps_theirs() { BTreeMap::new() } else { check_types(paths)? };
    let names = paths.iter().enumerate().map(|(at, path)| (format!("{:04}", at + 1), file_name(path)));
    new.metadata(metadata::MERGED, &names.collect())?;
    let sources = paths.iter().enumerate().map(|(number, path)| Source::open(number, path, &mut new));
    let mut sources = sources.collect::<Result<Vec<_>, _>>()?;
    let mut written = Written::default();
    let bytes: u64 = sources.iter().map(|source| source.contents.file_bytes()).sum();
    while let Some(source) = sources.iter_mut().filter(|its| its.next.is_some()).min_by_key(|its| its.arrival_ns()) {
        source.write_next(&mut new, &types, &mut written)?;
        source.advance(&mut new)?;
        progress(sources.iter().map(|source| source.contents.at()).sum(), bytes);
    }
    let mut losses: [BTreeMap<String, u64>; 2] = Default::default();
    for source in sources {
        for (id, channel) in source.contents.definitions().channels() {
            new.channel(source.number, id, &unified(channel, &types))?;
        }
        for (all, of_source) in losses.iter_mut().zip([source.lost, source.lost_by]) {
            for (key, count) in of_source {
                let sum = all.entry(key).or_default();
                *sum = sum.saturating_add(count);
            }
        }
    }
    for (name, all) in [metadata::LOST, metadata::LOST_BY].into_iter().zip(losses) {
        if !all.is_empty() {
            let texts = all.into_iter().map(|(key, count)| (key, count.to_string()));
            new.metadata(name, &texts.collect())?;
        }
    }
    let messages = new.messages();
    Ok((messages, new.finish()?))
}

/// The last message of each topic that was written: what a file repeats at its beginning may be that.
#[derive(Default)]
struct Written(BTreeMap<String, (Option<u64>, u32, u64)>);

impl Written {
    /// Whether it is to be written: not once more.
    fn takes(&mut self, found: &Found) -> bool {
        let Found { channel, header, .. } = found;
        let its = (channel.epoch(), header.sequence, header.publish_time);
        // Not each message is drawn, and some are drawn once in a file, of whichever message came first there.
        let is_drawn = channel.texts.contains_key(key::DRAWN);
        match self.0.get_mut(&channel.topic) {
            Some(last) if channel.is_repeated() && (is_drawn || *last == its) => return false,
            Some(last) => *last = its,
            None => drop(self.0.insert(channel.topic.clone(), its)),
        }
        true
    }
}

/// One of the files.
struct Source {
    number: usize,
    contents: Contents,
    /// Its next message.
    next: Option<Found>,
    /// What it says of its losses; the last counts.
    lost: BTreeMap<String, u64>,
    /// Messages lost, by topic and cause.
    lost_by: BTreeMap<String, u64>,
}

impl Source {
    /// At its first message.
    fn open(number: usize, path: &Path, new: &mut Rewriter) -> Result<Self, MergeError> {
        let (lost, lost_by) = Default::default();
        let mut source = Self { number, contents: Contents::open(path)?, next: None, lost, lost_by };
        source.advance(new)?;
        Ok(source)
    }

    fn arrival_ns(&self) -> Option<u64> {
        self.next.as_ref().map(|found| found.header.log_time)
    }

    fn write_next(
        &mut self,
        new: &mut Rewriter,
        types: &BTreeMap<String, Arc<SchemaText>>,
        written: &mut Written,
    ) -> Result<(), RewriteError> {
        let Some(found) = self.next.take().filter(|found| written.takes(found)) else { return Ok(()) };
        let Found { channel, header, .. } = &found;
        if !new.has_channel(self.number, header.channel_id) {
            new.channel(self.number, header.channel_id, &unified(channel, types))?;
        }
        new.message(self.number, channel, header, self.contents.data(&found))
    }

    /// Reads on to the next message.
    fn advance(&mut self, new: &mut Rewriter) -> Result<(), MergeError> {
        while let Some(item) = self.contents.next()? {
            match item {
                Item::Message(found) => {
                    self.next = Some(found);
                    return Ok(());
                }
                Item::Damaged(at, what) => return Err(self.contents.damaged(at, what).into()),
                Item::Metadata(its) if self.contents.heeds(&its) => self.tell(its, new)?,
                Item::Metadata(its) if new.keeps_theirs() => new.metadata(&its.name, &its.metadata)?,
                Item::Metadata(_) => {}
                Item::Attachment(attachment) => {
                    let at = attachment.index.offset;
                    let told = new.attachment::<MergeError>(self.contents.path(), attachment)?;
                    told.map_err(|what| self.contents.damaged(at, what))?;
                }
            }
        }
        match self.contents.ending() {
            Some(Ending::Closed) => Ok(()),
            _ => Err(ReadError::NotClosed { path: Shown(self.contents.path().to_owned()) }.into()),
        }
    }

    /// What it says of itself is said in the new file, with its name.
    fn tell(&mut self, its: Metadata, new: &mut Rewriter) -> Result<(), RewriteError> {
        let mut texts = its.metadata;
        match its.name.as_str() {
            metadata::LOST => self.lost = format::counts(&texts),
            metadata::LOST_BY => self.lost_by = format::counts(&texts),
            metadata::CLOSED => {}
            metadata::CONFIGURATION => new.metadata(&its.name, &texts)?,
            name if !is_our_word(name) => new.metadata(name, &texts)?,
            name => {
                texts.entry("source".into()).or_insert_with(|| file_name(self.contents.path()));
                new.metadata(name, &texts)?;
            }
        }
        Ok(())
    }
}

/// The type of each topic, if it is one.
fn check_types(paths: &[PathBuf]) -> Result<BTreeMap<String, Arc<SchemaText>>, MergeError> {
    let mut types: BTreeMap<String, (Arc<SchemaText>, &Path)> = BTreeMap::new();
    for path in paths {
        let Outline { definitions, .. } = Outline::read(&mut Frames::open(path)?)?;
        for (_, Definition { topic, schema, .. }) in definitions.channels().map(|(id, channel)| (id, &**channel)) {
            let (known, first) = types.entry(topic.clone()).or_insert_with(|| (schema.clone(), path));
            if !known.is_same_type(schema) {
                return Err(MergeError::OtherType {
                    topic: topic.as_str().into(),
                    first: Shown(first.to_owned()),
                    first_type: known.describe().into(),
                    second: Shown(path.clone()),
                    second_type: schema.describe().into(),
                });
            }
        }
    }
    Ok(types.into_iter().map(|(topic, (schema, _))| (topic, schema)).collect())
}

/// The same channel with the one description of its type: texts in it may have changed from file to file.
fn unified(channel: &Arc<Definition>, types: &BTreeMap<String, Arc<SchemaText>>) -> Arc<Definition> {
    match types.get(&channel.topic) {
        Some(schema) if *schema != channel.schema => {
            Arc::new(Definition { schema: schema.clone(), ..(**channel).clone() })
        }
        _ => channel.clone(),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
