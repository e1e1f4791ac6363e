//! A part of a recording: a time range, some names.

use crate::error::ReadError;
use crate::format::{key, metadata};
use crate::read::contents::{Contents, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::index::Index;
use crate::rewrite::{Progress, RewriteError, Rewriter};
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;

/// What is taken. The default takes all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// What arrived from then on, in nanoseconds of system time.
    pub from_ns: Option<u64>,
    /// What arrived before.
    pub until_ns: Option<u64>,
    /// Names (`laser.0`) or topics (`laser.0/scan`). None takes all.
    pub names: Vec<String>,
}

impl Selection {
    fn has_time(&self, first_ns: u64, last_ns: u64) -> bool {
        self.from_ns.is_none_or(|from| last_ns >= from) && self.until_ns.is_none_or(|until| first_ns < until)
    }

    fn has_channel(&self, channel: &Definition) -> bool {
        self.names.is_empty() || self.names.iter().any(|name| is_of(channel, name))
    }
}

fn is_of(channel: &Definition, name: &str) -> bool {
    channel.topic == name || channel.texts.get(key::NAME).is_some_and(|its| its == name)
}

/// Why nothing was cut out.
#[derive(Debug, Error)]
pub enum CutError {
    /// The old file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new one.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
    /// A typing mistake would make an empty file.
    #[error("the recording has no `{name}`; it has {}", there.join(", "))]
    NoName {
        /// What was asked for.
        name: String,
        /// All topics.
        there: Vec<String>,
    },
    /// The end is not behind the beginning.
    #[error("the time range is empty: it begins at {from_ns} ns and ends at {until_ns} ns")]
    NoTime {
        /// Begin.
        from_ns: u64,
        /// End.
        until_ns: u64,
    },
}

/// Writes what is selected to a new file; its messages and bytes. Reads only the chunks that have some of it. Counts of
/// lost messages remain those of the whole file.
///
/// # Errors
/// When the file was not closed or is damaged, has no such name, or the new one cannot be written.
pub fn cut(path: &Path, to: &Path, selection: &Selection, progress: &mut Progress<'_>) -> Result<(u64, u64), CutError> {
    if let (Some(from_ns), Some(until_ns)) = (selection.from_ns, selection.until_ns)
        && from_ns >= until_ns
    {
        return Err(CutError::NoTime { from_ns, until_ns });
    }
    let mut frames = Frames::open(path)?;
    let index = Index::read(&mut frames)?;
    check_names(&index, selection)?;
    let mut contents = Contents::new(frames, index.definitions.clone());
    let mut new = Rewriter::create(to)?;
    for at in &index.metadata {
        let metadata = contents.metadata_at(at.offset)?;
        if metadata.name != metadata::CLOSED {
            new.metadata(&metadata.name, metadata.metadata).map_err(RewriteError::from)?;
        }
    }
    new.metadata(metadata::CUT, about(path, selection)).map_err(RewriteError::from)?;
    let wanted = |id: u16| index.definitions.channel(id).is_some_and(|channel| selection.has_channel(channel));
    for (id, channel) in index.definitions.channels().filter(|(id, _)| wanted(*id)) {
        new.channel(0, id, channel).map_err(RewriteError::from)?;
    }
    let has_some = |chunk: &&mcap::records::ChunkIndex| {
        // Without an index of its messages, a chunk may have any.
        let offsets = &chunk.message_index_offsets;
        selection.has_time(chunk.message_start_time, chunk.message_end_time)
            && (offsets.is_empty() || offsets.keys().any(|id| wanted(*id)))
    };
    for chunk in index.chunks.iter().filter(has_some) {
        progress(chunk.chunk_start_offset, contents.file_bytes());
        contents.open_chunk(chunk.chunk_start_offset)?;
        while let Some(item) = contents.next_in_chunk() {
            match item {
                Item::Message(found) => {
                    let header = &found.header;
                    if selection.has_time(header.log_time, header.log_time) && wanted(header.channel_id) {
                        let data = contents.data(&found);
                        new.message(0, &found.channel, header, data).map_err(RewriteError::from)?;
                    }
                }
                Item::Damaged(at, what) => return Err(contents.damaged(at, what).into()),
                Item::Metadata(_) => {}
            }
        }
    }
    let messages = new.messages();
    Ok((messages, new.finish()?))
}

/// Each name is there.
fn check_names(index: &Index, selection: &Selection) -> Result<(), CutError> {
    let is_missing = |name: &&String| !index.definitions.channels().any(|(_, channel)| is_of(channel, name));
    let Some(name) = selection.names.iter().find(is_missing) else { return Ok(()) };
    let mut there: Vec<String> = index.definitions.channels().map(|(_, channel)| channel.topic.clone()).collect();
    there.sort();
    there.dedup();
    Err(CutError::NoName { name: name.clone(), there })
}

fn about(path: &Path, selection: &Selection) -> BTreeMap<String, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut texts = BTreeMap::from([("file".to_owned(), name)]);
    let times = [("from-ns", selection.from_ns), ("until-ns", selection.until_ns)];
    texts.extend(times.into_iter().filter_map(|(key, ns)| Some((key.to_owned(), ns?.to_string()))));
    if !selection.names.is_empty() {
        texts.insert("names".to_owned(), selection.names.join(" "));
    }
    texts
}
