//! Channels and their types, as a file describes them.

use crate::error::Damage;
use crate::format::{SCHEMA_ENCODING, is_of_others, key};
use mcap::records::{Header, Record};
use rohrpost_schema::{Type, describe_type};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A channel and its type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Definition {
    pub(crate) topic: String,
    pub(crate) message_encoding: String,
    pub(crate) texts: BTreeMap<String, String>,
    pub(crate) schema: Arc<SchemaText>,
}

/// A type, as it is described.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SchemaText {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
}

impl SchemaText {
    /// Of one of our types.
    pub(crate) fn ty(&self) -> Option<Type> {
        if self.encoding == SCHEMA_ENCODING { Type::from_bytes(&self.data).ok() } else { None }
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
        self.ty().map_or_else(|| format!("{} ({})", self.name, self.encoding), |ty| describe_type(&ty))
    }
}

impl Definition {
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
    /// Of another program: texts under our keys mean nothing, and are left out.
    are_others: bool,
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

    /// Reads a record of a schema or channel. The same again is no news.
    pub(crate) fn add(&mut self, op: u8, body: &[u8]) -> Result<(), Damage> {
        match mcap::parse_record(op, body).map_err(|_| Damage::Record { op })? {
            Record::Schema { header, data } => {
                let schema = SchemaText { name: header.name, encoding: header.encoding, data: data.into_owned() };
                insert(&mut self.schemas, header.id, Arc::new(schema))
            }
            Record::Channel(channel) => {
                let schema = match channel.schema_id {
                    0 => Arc::default(),
                    id => self.schemas.get(&id).cloned().ok_or(Damage::UnknownSchema(id))?,
                };
                let mcap::records::Channel { id, topic, message_encoding, metadata: mut texts, .. } = channel;
                if self.are_others {
                    texts.retain(|key, _| !key::ALL.contains(&key.as_str()));
                }
                insert(&mut self.channels, id, Arc::new(Definition { topic, message_encoding, texts, schema }))
            }
            _ => Err(Damage::Record { op }),
        }
    }
}

fn insert<T: PartialEq>(all: &mut BTreeMap<u16, T>, id: u16, new: T) -> Result<(), Damage> {
    match all.get(&id) {
        Some(known) if *known != new => Err(Damage::Redefined(id)),
        Some(_) => Ok(()),
        None => {
            all.insert(id, new);
            Ok(())
        }
    }
}
