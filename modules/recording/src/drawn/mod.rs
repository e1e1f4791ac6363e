//! Recordings for other programs: what Rerun and Foxglove draw, beside or in place of what was recorded.
//!
//! ```text
//! laser.0/scan  ──decode by its description──▶ Value ──Shape──▶ foxglove.PointCloud ──▶ laser.0/scan/points
//! odometry.0/odometry ─────────────────────────────▶ FrameTransform, PoseInFrame ──▶ …/transform, …/pose
//! ```
//!
//! Drawn channels say so in their metadata ([`key::DRAWN`]). They have the times, epoch and numbers of what they are
//! drawn of, and its stamp within.

mod beside;
mod clouds;
mod drawer;
mod fields;
mod kind;
mod one;
mod pictures;
mod poses;
mod proto;
mod schema;
#[cfg(test)]
mod tests;

use crate::error::{ReadError, RewriteError};
use crate::format::{key, metadata, our_header};
use crate::read::contents::Found;
use crate::read::selected::Selected;
use crate::rewrite::{Progress, Rewriter};
use crate::selection::{SelectError, Selection, listed};
pub(crate) use beside::DrawingBeside;
pub use beside::DrawnBeside;
use drawer::Drawer;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;

/// A longer message is not in one file both as it was recorded and drawn: fewer of its pixels or points are drawn.
const TWICE_BYTES_MAX: usize = 64 << 10;
/// Numbers of sources in the new file: what is copied, then what is drawn.
const COPIED: usize = 0;
const DRAWN: usize = 1;

/// How it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DrawOptions {
    /// What was recorded is copied, too. Of a value that is longer than 64 KiB fewer pixels or points are then drawn.
    pub with_original: bool,
    /// Names of classes by their numbers: output lines say which module they are of.
    pub classes: BTreeMap<u8, String>,
}

/// What was drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Length of the new file.
    pub bytes: u64,
    /// Its messages.
    pub messages: u64,
    /// Those of them that were drawn, by topic.
    pub drawn: BTreeMap<ForeignText, u64>,
    /// Values that could not be drawn, by topic: they contradict themselves, or have a place that is no number.
    pub not_drawn: BTreeMap<ForeignText, u64>,
    /// Values that are in the file as they were recorded, too long to be in it twice, and no pixels or points: by
    /// topic.
    pub too_long: BTreeMap<ForeignText, u64>,
    /// Topics of which nothing is drawn.
    pub without: Vec<ForeignText>,
    /// The module that is taken to carry scanners: their points are in its frame. None: they are in that of the world.
    pub carrier: Option<ForeignText>,
}

/// Why nothing was drawn.
#[derive(Debug, Error)]
pub enum DrawError {
    /// The old file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// What was selected of it.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// The new one.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
    /// There would be an empty file.
    #[error(
        "nothing of it can be drawn; poses, odometry, scans, points, images and output lines are drawn, and it has {}",
        listed(there)
    )]
    Nothing {
        /// Topics that were selected.
        there: Vec<ForeignText>,
    },
}

/// Draws what is selected into a new file. What was drawn before is drawn anew.
///
/// # Errors
/// When the file was not closed or is damaged, has no such name or nothing to draw, or the new one cannot be written.
pub fn draw(
    path: &Path,
    to: &Path,
    selection: &Selection,
    options: &DrawOptions,
    progress: &mut Progress<'_>,
) -> Result<Drawn, DrawError> {
    let mut selected = Selected::open(path, selection)?;
    let mut drawing = Drawing::new(&selected, options)?;
    let mut new = Rewriter::create(to, &our_header(), [path])?;
    selected.each_metadata(false, |its| {
        if options.with_original || ![metadata::LOST, metadata::LOST_BY].contains(&its.name.as_str()) {
            new.metadata(&its.name, &its.metadata)?;
        }
        Ok::<_, DrawError>(())
    })?;
    new.metadata(metadata::DRAWN, &selection.about(path))?;
    while let Some(found) = selected.next()? {
        progress(selected.at(), selected.file_bytes());
        drawing.message(&found, selected.data(&found), options.with_original, &mut new)?;
    }
    let messages = new.messages();
    Ok(Drawn { bytes: new.finish()?, messages, ..drawing.told })
}

/// What draws, and what came of it.
struct Drawing {
    drawer: Drawer,
    told: Drawn,
}

impl Drawing {
    fn new(selected: &Selected, options: &DrawOptions) -> Result<Self, DrawError> {
        let bytes_max = options.with_original.then_some(TWICE_BYTES_MAX);
        let mut drawing = Self { drawer: Drawer::new(options.classes.clone(), bytes_max), told: Drawn::default() };
        for (id, channel) in selected.channels().filter(|(_, its)| !its.texts.contains_key(key::DRAWN)) {
            if drawing.drawer.add(id, channel).is_none() {
                drawing.told.without.push(channel.topic.as_str().into());
            }
        }
        drawing.told.without.sort();
        drawing.told.without.dedup();
        if drawing.drawer.is_empty() {
            return Err(DrawError::Nothing { there: drawing.told.without });
        }
        drawing.told.carrier = drawing.drawer.carrier().map(|carrier| carrier.as_str().into());
        Ok(drawing)
    }

    fn message(
        &mut self,
        found: &Found,
        data: &[u8],
        with_original: bool,
        new: &mut Rewriter,
    ) -> Result<(), RewriteError> {
        let Found { channel, header, .. } = found;
        if with_original && !channel.texts.contains_key(key::DRAWN) {
            new.message(COPIED, channel, header, data)?;
        }
        let id = header.channel_id;
        if !self.drawer.draws(id) {
            return Ok(());
        }
        let count =
            |counts: &mut BTreeMap<ForeignText, u64>, topic: &str| *counts.entry(topic.into()).or_default() += 1;
        let Some(messages) = self.drawer.draw(id, channel, header.publish_time, data) else {
            count(&mut self.told.not_drawn, &channel.topic);
            return Ok(());
        };
        if messages.is_empty() {
            count(&mut self.told.too_long, &channel.topic);
        }
        for drawn in messages {
            count(&mut self.told.drawn, &drawn.channel.topic);
            new.message(DRAWN + drawn.number, &drawn.channel, header, &drawn.data)?;
        }
        Ok(())
    }
}
