//! Data of any module without its Rust type: tools decode, print, plot and encode it by its description.
//!
//! A description is an [`OwnedNamedType`] that a module hands out; the bytes are postcard's. Between the two stands
//! [`Value`], which also goes to and from JSON, as it implements serde's traits.
//!
//! ```text
//! bytes ──decode──▶ Value ──Display, numbers, serde──▶ terminal, plot, JSON
//! bytes ◀──encode── Value ◀──parse_argument, serde──── command line, JSON
//! ```
//!
//! Both descriptions and bytes come from other processes, so nothing here trusts them: no input panics, nesting ends at
//! [`DEPTH_MAX`], and a claimed length is compared with the bytes that are left before anything is allocated for it.
//!
//! What encodes and decodes again is the same, with one exception: which of the many NaNs an `f32` was may change.

mod argument;
mod decode;
mod described;
mod encode;
mod error;
mod json;
pub(crate) mod meta;
mod scalar;
mod show;
mod types;

#[cfg(test)]
mod tests;

pub use argument::parse_argument;
pub use decode::decode;
pub use described::{Described, read_described};
pub use encode::encode;
pub use error::{WalkError, WalkProblem};
pub use show::{LIST_SHOWN, Shown, numbers};
pub use types::{describe_result, describe_type, is_word};

use postcard_schema::Schema;
use postcard_schema::schema::owned::OwnedNamedType;
use serde::{Serialize, de::DeserializeOwned};

/// Descriptions and values nest no deeper than this.
pub const DEPTH_MAX: usize = 128;

/// Values that take no bytes (units, structs without fields) in one message: without a bound, three bytes could claim
/// a list of millions of them.
pub const EMPTY_MAX: usize = 65_536;

/// What can travel between modules: it has bytes, and a description by which tools read them.
///
/// ```
/// use rohrpost_modules::{types::Twist, value::{Data, decode}};
/// let bytes = postcard::to_stdvec(&Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 })?;
/// let value = decode(&Twist::schema(), &bytes)?;
/// assert_eq!(value.to_string(), "{speed_m_s: 0.5, turn_rate_rad_s: 0}");
/// assert!(decode(&Twist::schema(), &bytes[1..]).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Data: Serialize + DeserializeOwned + Schema + 'static {
    /// The description of this type, owned, so that it can be sent.
    fn schema() -> OwnedNamedType {
        OwnedNamedType::from(Self::SCHEMA)
    }
}

impl<T: Serialize + DeserializeOwned + Schema + 'static> Data for T {}

/// Data whose Rust type is not known.
///
/// Each type has one form, the one that [`decode`] gives; [`encode`] takes more, see there.
///
/// | Rust | here | JSON |
/// |---|---|---|
/// | `()`, unit struct, `None` | `Null` | `null` |
/// | `Some(x)` | `x`; where `x` itself can be `Null` (`Option<()>`, `Option<Option<u8>>`): `Variant("Some", x)` | `x`; `"Some"`, `{"Some": x}` |
/// | `u8` … `u128`; `i8` … `i128` | `U`; `I` | number; text if it fits no 64 bits |
/// | `f64`, `f32` | `F`; an `f32` as its shortest decimal: 1.2, not 1.2000000476837158 | number, `"NaN"`, `"inf"`, `"-inf"` |
/// | `Vec<u8>`, byte strings | `Bytes` | list |
/// | other lists, tuples, arrays | `List` | list |
/// | struct; map with keys of one word ([`is_word`]) | `Map` in the order of the bytes | object |
/// | map with other keys | `List` of `List`s of key and value | list of pairs |
/// | newtype struct | what it wraps | the same |
/// | enum | `Variant`; without payload: `Variant(name, Null)` | `{"name": payload}`; `"name"` |
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Nothing: a unit, or no value where one is optional.
    Null,
    /// True or false.
    Bool(bool),
    /// A whole number of a signed type.
    I(i128),
    /// A whole number of an unsigned type.
    U(u128),
    /// A number with a fraction.
    F(f64),
    /// One character.
    Char(char),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// Elements of a list or tuple.
    List(Vec<Value>),
    /// Fields of a struct, or entries of a map.
    Map(Vec<(String, Value)>),
    /// A choice by name, and what it carries (`Null`: nothing).
    Variant(String, Box<Value>),
}

impl Value {
    /// The choice `name` without payload.
    pub fn unit_variant(name: impl Into<String>) -> Self {
        Self::Variant(name.into(), Box::new(Self::Null))
    }
}
