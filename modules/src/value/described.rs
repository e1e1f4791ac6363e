//! Reading what contains descriptions. Whoever reads them by serde alone goes as deep as the bytes say, and two bytes a level
//! are enough: a note of 64 KB from another process would end a tool by its stack.

use super::{DEPTH_MAX, WalkError, WalkProblem, decode::decode_within, meta};
use postcard_schema::schema::owned::OwnedNamedType;
use serde::de::DeserializeOwned;

/// What is read of a description takes so many steps a level at least, so that lists and options nest to [`DEPTH_MAX`];
/// structs and enums, which take more, to a third of it.
const STEPS_MAX: usize = 3 * DEPTH_MAX;

/// What has descriptions of types inside.
pub trait Described: DeserializeOwned {
    /// How its bytes are made up, as [`Data::schema`](super::Data::schema) says it of types that have no description inside.
    fn shape() -> OwnedNamedType;
}

impl Described for OwnedNamedType {
    fn shape() -> OwnedNamedType {
        meta::DESCRIPTION.clone()
    }
}

/// Reads bytes of another process, all of them, without believing how deep they nest.
///
/// # Errors
/// What is wrong with them, and where.
pub fn read_described<T: Described>(bytes: &[u8]) -> Result<T, WalkError> {
    decode_within(STEPS_MAX, &T::shape(), bytes)?;
    postcard::from_bytes(bytes).map_err(|error| WalkProblem::NotRead { error: error.to_string() }.into())
}
