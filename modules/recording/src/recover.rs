//! A whole file from one that was not closed, or is damaged.

use crate::damages::Damages;
use crate::disk::is_being_written;
use crate::error::{Damage, ReadError, RewriteError, Shown};
use crate::format::{header_of_made, metadata};
use crate::read::contents::{Contents, Ending, Item};
use crate::read::definitions::Definitions;
use crate::read::frames::Frames;
use crate::read::index::Index;
use crate::rewrite::{Progress, Rewriter};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What was recovered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// The new file.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// Its messages.
    pub messages: u64,
    /// Of those, how many are of a chunk that the end of the file cuts off. They came before the cut; but no checksum
    /// says so.
    pub unchecked: u64,
    /// Length of the old file.
    pub bytes_before: u64,
    /// How far in the old file reading came.
    pub bytes_read: u64,
    /// The old one was closed.
    pub was_closed: bool,
    /// What was not readable: where, and why. The first hundred.
    pub damages: Vec<(u64, Damage)>,
    /// All of them.
    pub damage_count: u64,
}

/// Why nothing was recovered.
#[derive(Debug, Error)]
pub enum RecoverError {
    /// What is made of it now would lack what still comes.
    #[error("{0}: a recorder writes it just now; end the recording, or begin its next file: `rohrpost record rotate`")]
    BeingWritten(Shown),
    /// The old file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new one.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
}

/// Where [`recover`] puts the file that it makes of `path`: beside it, as `NAME.recovered.mcap`.
pub fn recovered_path(path: &Path) -> PathBuf {
    path.with_extension("recovered.mcap")
}

/// Makes a whole file of what is readable, at `to`. The old file stays as it is.
///
/// All messages before a cut are in it, and none that was not there. A chunk with a wrong checksum is left out, and
/// reading goes on behind it; behind a damaged type or length of a record, where the next one is found. Of a file that
/// another program wrote, its attachments, its metadata and its profile stay.
///
/// # Errors
/// When the old file is no MCAP file, or is being written, or the new one cannot be written.
pub fn recover(path: &Path, to: &Path, progress: &mut Progress<'_>) -> Result<Recovered, RecoverError> {
    if is_being_written(path) {
        return Err(RecoverError::BeingWritten(Shown(path.to_owned())));
    }
    let mut frames = Frames::open(path)?;
    // What the index describes need not be readable at its place.
    let known = match Index::read(&mut frames) {
        Ok(index) if index.is_checked => index.definitions,
        Err(error @ ReadError::Io { .. }) => return Err(error.into()),
        Ok(_) | Err(_) => Definitions::default(),
    };
    let header = Contents::header_of(path)?;
    frames.seek(mcap::MAGIC.len() as u64)?;
    let mut contents = Contents::new(frames, known);
    let mut new = Rewriter::create(to, &header_of_made([header.as_ref()]), [path])?;
    let (mut damages, mut unchecked) = (Damages::default(), 0);
    while let Some(item) = contents.next()? {
        progress(contents.at(), contents.file_bytes());
        match item {
            Item::Message(found) => {
                unchecked += u64::from(found.is_unchecked);
                new.message(0, &found.channel, &found.header, contents.data(&found))?;
            }
            Item::Metadata(metadata) if !contents.heeds(&metadata) && !new.keeps_theirs() => {}
            Item::Metadata(metadata) => new.metadata(&metadata.name, &metadata.metadata)?,
            Item::Attachment(attachment) => {
                let at = attachment.index.offset;
                if let Err(damage) = new.attachment::<RecoverError>(path, attachment)? {
                    damages.note(at, damage);
                }
            }
            Item::Damaged(at, damage) => damages.note(at, damage),
        }
    }
    for (id, channel) in contents.definitions().channels() {
        new.channel(0, id, channel)?;
    }
    let (bytes_before, bytes_read) = (contents.file_bytes(), contents.at());
    let was_closed = contents.ending() == Some(Ending::Closed);
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let about = [
        ("file", name),
        ("bytes", bytes_before.to_string()),
        ("bytes-read", bytes_read.to_string()),
        ("was-closed", was_closed.to_string()),
        ("damages", damages.count.to_string()),
        ("unchecked", unchecked.to_string()),
    ];
    let about: BTreeMap<String, String> = about.into_iter().map(|(key, text)| (key.to_owned(), text)).collect();
    new.metadata(metadata::RECOVERED, &about)?;
    let messages = new.messages();
    let bytes = new.finish()?;
    Ok(Recovered {
        path: to.to_owned(),
        bytes,
        messages,
        unchecked,
        bytes_before,
        bytes_read,
        was_closed,
        damages: damages.listed,
        damage_count: damages.count,
    })
}

impl RecoverError {
    /// The file that is in the way, if it is that.
    pub fn existing(&self) -> Option<&Shown> {
        match self {
            Self::Rewrite(RewriteError::Exists(path)) => Some(path),
            _ => None,
        }
    }
}
