//! Channels and their types, as a file describes them.

use crate::error::{Damage, FileLimit};
use crate::format::{SCHEMA_ENCODING, is_of_others, key};
use crate::read::cost::DescribedBytes;
use mcap::records::{Header, Record};
use rohrpost_schema::{Type, describe_type};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a channel takes besides its texts, and how often these are there: a map has nodes, and readers have copies.
const CHANNEL_BYTES: usize = 512;
const TEXTS_FACTOR: usize = 8;

/// A channel and its type.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Definition {
    pub(crate) topic: String,
    pub(crate) message_encoding: String,
    pub(crate) texts: BTreeMap<String, String>,
    /// Texts of another program under keys of ours, where they mean something else.
    pub(crate) unheeded: BTreeMap<String, String>,
    pub(crate) schema: Arc<SchemaText>,
}

/// Topic, encoding, type, texts: see [`Definition::identity`].
pub(crate) type ChannelIdentity<'a> =
    (&'a str, &'a str, Option<*const SchemaText>, Option<Vec<(&'a String, &'a String)>>);

/// A type, as it is described: once for all of its channels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SchemaText {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
    ty: Option<Arc<Type>>,
}

impl SchemaText {
    pub(crate) fn new(name: String, encoding: String, data: Vec<u8>) -> Self {
        let is_ours = encoding == SCHEMA_ENCODING;
        let ty = if is_ours { Type::from_bytes(&data).ok().map(Arc::new) } else { None };
        Self { name, encoding, data, ty }
    }

    /// Of one of our types.
    pub(crate) fn ty(&self) -> Option<&Arc<Type>> {
        self.ty.as_ref()
    }

    /// Whether values of one are values of the other. Of our types, texts and ranges do not count.
    pub(crate) fn is_same_type(&self, other: &Self) -> bool {
        match (self.ty(), other.ty()) {
            (Some(one), Some(other)) => one.hash() == other.hash(),
            _ => self == other,
        }
    }

    /// For people.
    pub(crate) fn describe(&self) -> String {
        self.ty().map_or_else(|| format!("{} ({})", self.name, self.encoding), |ty| describe_type(ty))
    }
}

impl Definition {
    /// What channels have in common that are told as one: a topic of ours has a channel for each epoch. Channels of
    /// others with different texts are different ones.
    pub(crate) fn identity(&self) -> ChannelIdentity<'_> {
        let schema = (*self.schema != SchemaText::default()).then_some(Arc::as_ptr(&self.schema));
        let texts = || self.texts.iter().filter(|(key, _)| *key != key::REPEATED).chain(&self.unheeded);
        let texts = self.schema.ty().is_none().then(|| texts().collect());
        (&self.topic, &self.message_encoding, schema, texts)
    }

    /// Whether its messages are from an earlier file, as the beginning of this one.
    pub(crate) fn is_repeated(&self) -> bool {
        self.texts.contains_key(key::REPEATED)
    }

    /// Of system time.
    pub(crate) fn epoch(&self) -> Option<u64> {
        self.texts.get(key::EPOCH)?.parse().ok()
    }
}

/// All of a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Definitions {
    schemas: BTreeMap<u16, Arc<SchemaText>>,
    channels: BTreeMap<u16, Arc<Definition>>,
    /// Of another program: texts under our keys mean nothing.
    are_others: bool,
    memory: DescribedBytes,
}

/// Why a record of a schema or channel is not taken.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Untaken {
    Damaged(Damage),
    TooMuch(FileLimit),
}

impl From<Damage> for Untaken {
    fn from(damage: Damage) -> Self {
        Self::Damaged(damage)
    }
}

impl From<FileLimit> for Untaken {
    fn from(limit: FileLimit) -> Self {
        Self::TooMuch(limit)
    }
}

impl Definitions {
    /// Takes notice of what wrote the file. Before, it is taken for one of ours: its header may be damaged.
    pub(crate) fn know(&mut self, header: &Header) {
        self.are_others = is_of_others(header);
    }

    /// Whether they are of another program's file.
    pub(crate) fn are_others(&self) -> bool {
        self.are_others
    }

    pub(crate) fn channel(&self, id: u16) -> Option<&Arc<Definition>> {
        self.channels.get(&id)
    }

    pub(crate) fn channels(&self) -> impl Iterator<Item = (u16, &Arc<Definition>)> {
        self.channels.iter().map(|(id, definition)| (*id, definition))
    }

    /// What all of it takes.
    pub(crate) fn memory(&self) -> DescribedBytes {
        self.memory
    }

    /// Reads a record of a schema or channel. The same again is no news.
    pub(crate) fn add(&mut self, op: u8, body: &[u8]) -> Result<(), Untaken> {
        match mcap::parse_record(op, body).map_err(|_| Damage::Record { op })? {
            Record::Schema { header, data } => {
                if let Some(known) = self.schemas.get(&header.id) {
                    let is_same =
                        (&known.name, &known.encoding, &*known.data) == (&header.name, &header.encoding, &*data);
                    return if is_same { Ok(()) } else { Err(Damage::Redefined(header.id).into()) };
                }
                let schema = SchemaText::new(header.name, header.encoding, data.into_owned());
                self.memory.add(body.len(), schema.ty().map_or(0, |ty| ty.memory_bytes()))?;
                self.schemas.insert(header.id, Arc::new(schema));
            }
            Record::Channel(channel) => {
                let schema = match channel.schema_id {
                    0 => Arc::default(),
                    id => self.schemas.get(&id).cloned().ok_or(Damage::UnknownSchema(id))?,
                };
                let mcap::records::Channel { id, topic, message_encoding, metadata: mut texts, .. } = channel;
                let mut unheeded = BTreeMap::new();
                if self.are_others {
                    unheeded.extend(texts.extract_if(.., |key, _| key::ALL.contains(&key.as_str())));
                    if let Some(text) = texts.remove(key::REPEATED_OF_OTHERS) {
                        texts.insert(key::REPEATED.into(), text);
                    }
                }
                let channel = Arc::new(Definition { topic, message_encoding, texts, unheeded, schema });
                if let Some(known) = self.channels.get(&id) {
                    return if *known == channel { Ok(()) } else { Err(Damage::Redefined(id).into()) };
                }
                self.memory.add(CHANNEL_BYTES + TEXTS_FACTOR * body.len(), 0)?;
                self.channels.insert(id, channel);
            }
            _ => return Err(Damage::Record { op }.into()),
        }
        Ok(())
    }
}
