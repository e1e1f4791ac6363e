//! Descriptions as serde sees them: for people as JSON; in postcard a [`Field`] is its own bytes with their length
//! before them.

use crate::Field;
use serde::de::{self, Deserialize, Deserializer, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;

impl Serialize for Field {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !serializer.is_human_readable() {
            return serializer.serialize_bytes(&self.to_bytes());
        }
        let mut map = serializer.serialize_map(None)?;
        for (key, word) in [("name", &self.name), ("text", &self.text), ("unit", &self.unit)] {
            if !word.is_empty() {
                map.serialize_entry(key, word)?;
            }
        }
        map.serialize_entry("type", &self.ty)?;
        let (least, most) = self.bounds();
        for (key, bound) in [("min", least), ("max", most)] {
            if let Some(value) = bound {
                map.serialize_entry(key, &value)?;
            }
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Field {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_bytes(FieldVisitor)
    }
}

struct FieldVisitor;

impl Visitor<'_> for FieldVisitor {
    type Value = Field;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the bytes of a field")
    }

    fn visit_bytes<E: de::Error>(self, bytes: &[u8]) -> Result<Field, E> {
        Field::from_bytes(bytes).map_err(E::custom)
    }
}
