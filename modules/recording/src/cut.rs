//! A part of a recording: a time range, some names.

use crate::error::{ReadError, RewriteError};
use crate::format::{header_of_made, metadata};
use crate::newest::KEPT_BYTES_MAX;
use crate::read::before::{EarlierMessage, PartStart, newest_before};
use crate::read::contents::Contents;
use crate::read::definitions::Definition;
use crate::read::selected::Selected;
use crate::rewrite::{Progress, Rewriter};
use crate::selection::{SelectError, Selection};
use mcap::records::MessageHeader;
use std::path::Path;
use thiserror::Error;

/// Why nothing was cut out.
#[derive(Debug, Error)]
pub enum CutError {
    /// The old file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// What was selected of it.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// The new one.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
}

/// Numbers of sources in the new file: what is selected, and what it begins with.
const SELECTED: usize = 0;
const EARLIER: usize = 1;

/// Writes what is selected to a new file; its messages and bytes. Reads only the chunks that have some of it. Counts of
/// lost messages remain those of the whole file.
///
/// All attachments are kept, and of a file that another program wrote its metadata and its profile.
///
/// The new file begins with the newest message of each selected topic from before the time range, as each file of a
/// recording does. They do not count as its messages.
///
/// # Errors
/// When the file was not closed or is damaged, has no such name, or the new one cannot be written.
pub fn cut(path: &Path, to: &Path, selection: &Selection, progress: &mut Progress<'_>) -> Result<(u64, u64), CutError> {
    let mut selected = Selected::open(path, selection)?;
    let mut new = Rewriter::create(to, &header_of_made([Contents::header_of(path)?.as_ref()]), [path])?;
    selected.each_metadata(new.keeps_theirs(), |its| Ok::<_, CutError>(new.metadata(&its.name, &its.metadata)?))?;
    for attachment in selected.take_attachments() {
        let at = attachment.index.offset;
        new.attachment::<CutError>(path, attachment)?.map_err(|what| selected.damaged(at, what))?;
    }
    new.metadata(metadata::CUT, &selection.about(path))?;
    for (id, channel) in selected.channels() {
        new.channel(SELECTED, id, channel)?;
    }
    let mut next = selected.next()?;
    if let Some(from_ns) = selection.from_ns {
        let epoch = next.as_ref().map(|found| found.channel.epoch().unwrap_or_default());
        let is_selected = |channel: &Definition| selection.has_channel(channel);
        let earlier = newest_before(path, &is_selected, PartStart { epoch, from_ns }, KEPT_BYTES_MAX)?;
        earlier.unread.map_or(Ok(()), Err)?;
        let log_time = next.as_ref().map_or(from_ns, |found| found.header.log_time);
        for EarlierMessage { channel, header, data } in earlier.messages {
            let header = MessageHeader { log_time, ..header };
            new.message(EARLIER, &channel, &header, &data)?;
        }
    }
    while let Some(found) = next {
        progress(selected.at(), selected.file_bytes());
        new.message(SELECTED, &found.channel, &found.header, selected.data(&found))?;
        next = selected.next()?;
    }
    let messages = new.messages();
    Ok((messages, new.finish()?))
}
