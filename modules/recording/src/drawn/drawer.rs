//! Channels that can be drawn, and the messages that are drawn of theirs: those of a new file, or of the file that is
//! recorded.

use super::kind::Kind;
use super::one::{DrawnPart, Origin, WORLD, draw_one, draw_world};
use super::schema;
use crate::format::{MESSAGE_ENCODING, key};
use crate::read::definitions::{Definition, SchemaText};
use crate::shape::Shape;
use rohrpost_schema::{Type, decode};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A longer scan is none that a scanner makes, and is not drawn in part: half a million beams take it.
const SCAN_BYTES_MAX: usize = 1 << 20;

/// Draws messages of one file, one after the other.
pub(crate) struct Drawer {
    /// By the numbers of what they are drawn of.
    sources: BTreeMap<u16, DrawnChannel>,
    /// Of all kinds.
    schema: Vec<u8>,
    /// It is said where the world is.
    has_world: bool,
    /// The module that is taken to carry scanners.
    carrier: Option<String>,
    /// Names of classes by their numbers.
    classes: BTreeMap<u8, String>,
    /// Of a longer message at most so much is drawn.
    bytes_max: Option<usize>,
}

/// A channel that is drawn.
struct DrawnChannel {
    module: String,
    shape: Shape,
    ty: Arc<Type>,
    /// As the file has them, once there is a message: by kind, and whether they are reduced.
    kinds: BTreeMap<(Kind, bool), Arc<Definition>>,
}

/// A message that was drawn.
pub(crate) struct DrawnMessage {
    /// Apart from those of other kinds: below [`DrawnMessage::NUMBERS`].
    pub(crate) number: usize,
    pub(crate) channel: Arc<Definition>,
    pub(crate) data: Vec<u8>,
}

impl DrawnMessage {
    /// Kinds, reduced and not, and where the world is.
    const NUMBERS: usize = 2 * Kind::ALL.len() + 1;
}

impl Drawer {
    /// With a bound, of messages that are longer at most so many bytes of pixels or points are drawn, and nothing of
    /// all others.
    pub(crate) fn new(classes: BTreeMap<u8, String>, bytes_max: Option<usize>) -> Self {
        let (sources, schema) = (BTreeMap::new(), schema::descriptor_set());
        Self { sources, schema, has_world: false, carrier: None, classes, bytes_max }
    }

    /// Adds a channel of the file; what its values look like, if they are drawn. A drawn channel is not.
    pub(crate) fn add(&mut self, id: u16, channel: &Definition) -> Option<Shape> {
        let source = DrawnChannel::of(channel)?;
        let shape = source.shape;
        self.sources.insert(id, source);
        let of = |shape| self.sources.values().filter(move |its| its.shape == shape).map(|its| &its.module).min();
        self.carrier = of(Shape::Odometry).or_else(|| of(Shape::Pose)).cloned();
        Some(shape)
    }

    /// Whether nothing is drawn.
    pub(crate) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Whether messages of a channel are drawn.
    pub(crate) fn draws(&self, id: u16) -> bool {
        self.sources.contains_key(&id)
    }

    /// The module that is taken to carry scanners: their points are in its frame. None: they are in that of the world.
    pub(crate) fn carrier(&self) -> Option<&String> {
        self.carrier.as_ref()
    }

    /// Draws a value of a channel; none if it contradicts itself, or is nowhere; nothing if it is too long. With the
    /// first one in space comes where the world is.
    pub(crate) fn draw(
        &mut self,
        id: u16,
        channel: &Definition,
        stamp_ns: u64,
        data: &[u8],
    ) -> Option<Vec<DrawnMessage>> {
        let source = self.sources.get_mut(&id)?;
        let bytes_max = self.bytes_max.filter(|max| data.len() > *max);
        let is_too_long = source.shape == Shape::Scan && data.len() > SCAN_BYTES_MAX;
        if bytes_max.is_some() && (is_too_long || !source.shape.can_be_reduced()) {
            return Some(Vec::new());
        }
        let origin = Origin {
            module: &source.module,
            carrier: self.carrier.as_deref().unwrap_or(WORLD),
            stamp_ns,
            classes: &self.classes,
        };
        let value = decode(&source.ty, data).ok()?;
        let parts = draw_one(source.shape, value, &origin, bytes_max.unwrap_or(usize::MAX))?;
        let mut drawn = Vec::with_capacity(parts.len() + 1);
        if !self.has_world && parts.iter().any(|part| part.kind.is_in_space()) {
            self.has_world = true;
            let world = drawn_channel(WORLD, Kind::Transform, false, channel, &self.schema);
            drawn.push(DrawnMessage { number: DrawnMessage::NUMBERS - 1, channel: world, data: draw_world(stamp_ns) });
        }
        for DrawnPart { kind, is_reduced, data } in parts {
            let channel = source.channel(kind, is_reduced, channel, &self.schema).clone();
            drawn.push(DrawnMessage { number: 2 * kind as usize + usize::from(is_reduced), channel, data });
        }
        Some(drawn)
    }
}

impl DrawnChannel {
    fn of(channel: &Definition) -> Option<Self> {
        let ty = channel.schema.ty().filter(|_| channel.message_encoding == MESSAGE_ENCODING)?.clone();
        let module = channel.texts.get(key::NAME).unwrap_or(&channel.topic).clone();
        Some(Self { module, shape: Shape::of(&ty)?, ty, kinds: BTreeMap::new() })
    }

    fn channel(&mut self, kind: Kind, is_reduced: bool, of: &Definition, schema: &[u8]) -> &Arc<Definition> {
        let new = || drawn_channel(&of.topic, kind, is_reduced, of, schema);
        self.kinds.entry((kind, is_reduced)).or_insert_with(new)
    }
}

/// A channel below a topic, marked as drawn of another one.
fn drawn_channel(topic: &str, kind: Kind, is_reduced: bool, of: &Definition, schema: &[u8]) -> Arc<Definition> {
    let mut texts = of.texts.clone();
    texts.insert(key::DRAWN.into(), of.topic.clone());
    if is_reduced {
        texts.insert(key::REDUCED.into(), "true".into());
    }
    Arc::new(Definition {
        topic: format!("{topic}/{}", kind.suffix()),
        message_encoding: schema::MESSAGE_ENCODING.into(),
        texts,
        schema: Arc::new(SchemaText::new(
            format!("foxglove.{}", kind.message_name()),
            schema::SCHEMA_ENCODING.into(),
            schema.to_vec(),
        )),
        ..Definition::default()
    })
}
