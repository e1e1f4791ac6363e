//! Bytes inside of a value, seen where they lie.

use rohrpost_schema::{Schema, Type};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::ops::Deref;

/// What [`Bytes`](rohrpost_schema::Bytes) are in a view: in the memory that the value was read from. Like them, they
/// are written as one piece, and described as bytes.
///
/// ```
/// use rohrpost_modules::types::{Bytes, BytesView};
///
/// let bytes = postcard::to_stdvec(&Bytes(vec![7, 8, 9]))?;
/// let view: BytesView<'_> = postcard::from_bytes(&bytes)?;
/// assert_eq!(view.as_ptr(), bytes[1..].as_ptr()); // behind their length
/// assert_eq!(postcard::to_stdvec(&view)?, bytes);
/// # Ok::<(), postcard::Error>(())
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct BytesView<'a>(pub &'a [u8]);

impl Deref for BytesView<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0
    }
}

impl AsRef<[u8]> for BytesView<'_> {
    fn as_ref(&self) -> &[u8] {
        self.0
    }
}

/// How many: a picture has millions.
impl fmt::Debug for BytesView<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}

impl Schema for BytesView<'_> {
    const LEVELS: usize = 1;

    fn schema() -> Type {
        Type::Bytes
    }
}

impl Serialize for BytesView<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for BytesView<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Deserialize::deserialize(deserializer).map(Self)
    }
}

#[cfg(test)]
#[path = "bytes_tests.rs"]
mod tests;
