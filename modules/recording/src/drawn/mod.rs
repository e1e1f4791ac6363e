//! Recordings for other programs: what Rerun and Foxglove draw, beside or in place of what was recorded.
//!
//! ```text
//! laser.0/scan  ──decode by its description──▶ Value ──Shape──▶ foxglove.PointCloud ──▶ laser.0/scan/points
//! odometry.0/odometry ─────────────────────────────▶ FrameTransform, PoseInFrame ──▶ …/transform, …/pose
//! ```
//!
//! Drawn channels say so in their metadata ([`key::DRAWN`]). They have the times, epoch and numbers of what they are
//! drawn of, and its stamp within.

mod clouds;
mod fields;
mod kind;
mod one;
mod pictures;
mod poses;
mod proto;
mod schema;

use crate::error::{DiskError, ReadError};
use crate::format::{MESSAGE_ENCODING, key, metadata};
use crate::read::contents::Found;
use crate::read::definitions::{Definition, SchemaText};
use crate::read::selected::Selected;
use crate::rewrite::{Progress, RewriteError, Rewriter};
use crate::selection::{SelectError, Selection, listed};
use crate::shape::Shape;
use kind::Kind;
use one::{Origin, WORLD, draw_one, draw_world};
use rohrpost_schema::{Type, decode};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use thiserror::Error;

/// A longer message is not in one file both as it was recorded and drawn.
const TWICE_BYTES_MAX: usize = 64 << 10;
/// Numbers of sources in the new file: what is copied, then what is drawn.
const COPIED: usize = 0;
const DRAWN: usize = 1;
const WORLDS: usize = DRAWN + Kind::ALL.len();

/// How it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DrawOptions {
    /// What was recorded is copied, too. A value that is longer than 64 KiB is then not drawn.
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
    pub drawn: BTreeMap<String, u64>,
    /// Values that could not be drawn, by topic: they contradict themselves, or have a place that is no number.
    pub not_drawn: BTreeMap<String, u64>,
    /// Values that are in the file as they were recorded, and too long to be in it twice, by topic.
    pub too_long: BTreeMap<String, u64>,
    /// Topics of which nothing is drawn.
    pub without: Vec<String>,
    /// The module that is taken to carry scanners: their points are in its frame. None: they are in that of the world.
    pub carrier: Option<String>,
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
        there: Vec<String>,
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
    let mut drawing = Drawing::new(&selected)?;
    let mut new = Rewriter::create(to)?;
    selected.each_metadata(|its| {
        if options.with_original || its.name != metadata::LOST {
            new.metadata(&its.name, its.metadata).map_err(RewriteError::from)?;
        }
        Ok::<_, DrawError>(())
    })?;
    new.metadata(metadata::DRAWN, selection.about(path)).map_err(RewriteError::from)?;
    while let Some(found) = selected.next()? {
        progress(selected.at(), selected.file_bytes());
        drawing.message(&found, selected.data(&found), options, &mut new).map_err(RewriteError::from)?;
    }
    let messages = new.messages();
    Ok(Drawn { bytes: new.finish()?, messages, ..drawing.told })
}

/// Channels that are drawn, and what came of it.
struct Drawing {
    sources: BTreeMap<u16, DrawnChannel>,
    /// Of all kinds.
    schema: Vec<u8>,
    /// It is said where the world is.
    has_world: bool,
    told: Drawn,
}

/// A channel that is drawn.
struct DrawnChannel {
    module: String,
    shape: Shape,
    ty: Type,
    /// As the new file has them, once there is a message.
    kinds: BTreeMap<Kind, Arc<Definition>>,
}

impl Drawing {
    fn new(selected: &Selected) -> Result<Self, DrawError> {
        let mut drawing = Self {
            sources: BTreeMap::new(),
            schema: schema::descriptor_set(),
            has_world: false,
            told: Drawn::default(),
        };
        for (id, channel) in selected.channels().filter(|(_, its)| !its.texts.contains_key(key::DRAWN)) {
            match DrawnChannel::of(channel) {
                Some(source) => drop(drawing.sources.insert(id, source)),
                None => drawing.told.without.push(channel.topic.clone()),
            }
        }
        drawing.told.without.sort();
        drawing.told.without.dedup();
        if drawing.sources.is_empty() {
            return Err(DrawError::Nothing { there: drawing.told.without });
        }
        let of = |shape| drawing.sources.values().filter(move |its| its.shape == shape).map(|its| &its.module).min();
        drawing.told.carrier = of(Shape::Odometry).or_else(|| of(Shape::Pose)).cloned();
        Ok(drawing)
    }

    fn message(
        &mut self,
        found: &Found,
        data: &[u8],
        options: &DrawOptions,
        new: &mut Rewriter,
    ) -> Result<(), DiskError> {
        let Found { channel, header, .. } = found;
        if options.with_original && !channel.texts.contains_key(key::DRAWN) {
            new.message(COPIED, channel, header, data)?;
        }
        let Some(source) = self.sources.get_mut(&header.channel_id) else { return Ok(()) };
        let count = |counts: &mut BTreeMap<String, u64>, topic: &str| *counts.entry(topic.into()).or_default() += 1;
        if options.with_original && data.len() > TWICE_BYTES_MAX {
            count(&mut self.told.too_long, &channel.topic);
            return Ok(());
        }
        let origin = Origin {
            module: &source.module,
            carrier: self.told.carrier.as_deref().unwrap_or(WORLD),
            stamp_ns: header.publish_time,
            classes: &options.classes,
        };
        let value = decode(&source.ty, data).ok();
        let Some(messages) = value.and_then(|value| draw_one(source.shape, value, &origin)) else {
            count(&mut self.told.not_drawn, &channel.topic);
            return Ok(());
        };
        if !self.has_world && messages.iter().any(|(kind, _)| kind.is_in_space()) {
            self.has_world = true;
            let world = drawn_channel(WORLD, Kind::Transform, channel, &self.schema);
            count(&mut self.told.drawn, &world.topic);
            new.message(WORLDS, &world, header, &draw_world(header.publish_time))?;
        }
        for (kind, message) in messages {
            let drawn = source.channel(kind, channel, &self.schema);
            count(&mut self.told.drawn, &drawn.topic);
            new.message(DRAWN + kind as usize, drawn, header, &message)?;
        }
        Ok(())
    }
}

impl DrawnChannel {
    fn of(channel: &Definition) -> Option<Self> {
        let ty = channel.schema.ty().filter(|_| channel.message_encoding == MESSAGE_ENCODING)?;
        let module = channel.texts.get(key::NAME).unwrap_or(&channel.topic).clone();
        Some(Self { module, shape: Shape::of(&ty)?, ty, kinds: BTreeMap::new() })
    }

    fn channel(&mut self, kind: Kind, of: &Definition, schema: &[u8]) -> &Arc<Definition> {
        self.kinds.entry(kind).or_insert_with(|| drawn_channel(&of.topic, kind, of, schema))
    }
}

/// A channel below a topic, marked as drawn of another one.
fn drawn_channel(topic: &str, kind: Kind, of: &Definition, schema: &[u8]) -> Arc<Definition> {
    let mut texts = of.texts.clone();
    texts.insert(key::DRAWN.into(), of.topic.clone());
    Arc::new(Definition {
        topic: format!("{topic}/{}", kind.suffix()),
        message_encoding: schema::MESSAGE_ENCODING.into(),
        texts,
        schema: Arc::new(SchemaText {
            name: format!("foxglove.{}", kind.message_name()),
            encoding: schema::SCHEMA_ENCODING.into(),
            data: schema.to_vec(),
        }),
    })
}
