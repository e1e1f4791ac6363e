//! Types of what travels between modules: described by the program that has them, read by others that do not.
//!
//! A module hands out a [`Description`] of its interface, bytes by a table of our own (`docs/src/wire.md`). In it are
//! [`Type`]s; values are postcard's bytes. Between the two stands [`Value`], which also goes to and from JSON, as it
//! implements serde's traits.
//!
//! ```text
//! struct ──derive(Schema)──▶ Type ──to_bytes, from_bytes──▶ others; hash
//!
//! bytes ──decode──▶ Value ──Display, numbers, serde──▶ terminal, plot, JSON
//! bytes ◀──encode── Value ◀──parse_argument, serde──── command line, JSON
//! ```
//!
//! Both descriptions and bytes come from other processes, so nothing here trusts them: no input panics, nesting ends at
//! [`DEPTH_MAX`], a claimed length is compared with the bytes that are left before anything is allocated for it, and
//! all values of a message are counted (`budget.rs`).
//!
//! Texts of others are shown as [`plain`] writes them.
//!
//! What encodes and decodes again is the same, with one exception: which of the many NaNs an `f32` was may change.
//!
//! Knows no mailbox and no module.

#![forbid(unsafe_code)]

// So that what the derive writes means this crate in it, too.
#[cfg(test)]
extern crate self as rohrpost_schema;

mod argument;
mod bounds;
mod budget;
mod byte_field;
mod bytes;
mod decode;
mod description;
mod encode;
mod error;
mod json;
mod label;
pub mod plain;
mod quantities;
mod scalar;
mod serial;
mod show;
mod standard;
#[cfg(test)]
mod tests;
mod tree;
mod value;
mod words;

pub use argument::parse_argument;
pub use byte_field::Bytes;
pub use bytes::{SchemaError, TYPES_MAX, VERSION, hash};
pub use decode::decode;
pub use description::{DataItem, DataKind, Description, Function};
pub use encode::encode;
pub use error::{WalkError, WalkProblem};
pub use label::Label;
pub use quantities::{counters, quantities, quantity_fields};
pub use rohrpost_macros::Schema;
pub use show::{LIST_SHOWN, Shown, numbers};
pub use tree::{Field, Members, Named, Type};
pub use value::Value;
pub use words::{describe_field, describe_result, describe_type, is_word};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Descriptions and values nest no deeper than this.
pub const DEPTH_MAX: usize = 128;

/// Values that take no bytes (units, structs without fields) in one message: without a bound, three bytes could claim
/// a list of millions of them.
pub const EMPTY_MAX: usize = 65_536;

/// Values in one message, but for the contents of bytes and texts, and for numbers in a list of `f32` or `f64`: a scan
/// of 2 048 x 128 points of four named numbers has 1.3 million. Some 200 MB of memory here, and twice that in Python.
pub const VALUES_MAX: usize = 4_000_000;

/// Values for each byte of a message. A number takes one byte at least, and is in a struct or two; real types stay
/// below four.
pub const VALUES_PER_BYTE: usize = 8;

/// So many bytes of a name count as another value.
pub const NAME_BYTES: usize = 64;

/// What has a description. The derive of the same name writes it for structs and enums:
///
/// ```
/// use rohrpost_schema::{Schema, describe_type};
///
/// /// How fast it goes.
/// #[derive(Schema)]
/// struct Pace {
///     /// Forward.
///     #[schema(unit = "m/s", min = 0.0, max = 1.5)]
///     speed: f64,
/// }
/// assert_eq!(describe_type(&Pace::schema()), "{speed: f64}");
/// ```
///
/// Doc comments become texts; `#[schema(name = "…")]` before a struct or enum gives it another name than Rust's.
/// Serde's `rename` is followed. A type that contains itself does not compile:
///
/// ```compile_fail,E0391
/// #[derive(rohrpost_schema::Schema)]
/// struct Tree {
///     branches: Vec<Tree>,
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no description, so it cannot travel between modules",
    note = "write `#[rohrpost::data]` before it, or `#[derive(Schema)]`"
)]
pub trait Schema {
    /// Types inside of each other, at least 1. A type that contains itself has no such number; so the compiler finds
    /// it.
    const LEVELS: usize;

    /// The description of this type.
    fn schema() -> Type;
}

impl Type {
    /// Whether it is the type that `T` describes; texts and ranges may differ.
    pub fn is<T: Schema>(&self) -> bool {
        self.bare_bytes() == T::schema().bare_bytes()
    }
}

/// [`Schema::LEVELS`] of what has these inside.
#[doc(hidden)]
pub const fn deeper(inner: &[usize]) -> usize {
    let (mut most, mut at) = (0, 0);
    while at < inner.len() {
        most = if inner[at] > most { inner[at] } else { most };
        at += 1;
    }
    assert!(most < DEPTH_MAX, "types nest too deep to be described");
    most + 1
}

/// A bound of a field, which an attribute writes.
#[doc(hidden)]
pub fn bound<T: Serialize>(value: &T) -> Option<Vec<u8>> {
    postcard::to_stdvec(value).ok()
}

/// What can travel between modules: it has bytes, and a description by which tools read them.
///
/// ```
/// use rohrpost_schema::{Schema, decode};
/// #[derive(serde::Serialize, Schema)]
/// struct Twist { speed_m_s: f64, turn_rate_rad_s: f64 }
/// let bytes = postcard::to_stdvec(&Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 })?;
/// let value = decode(&Twist::schema(), &bytes)?;
/// assert_eq!(value.to_string(), "{speed_m_s: 0.5, turn_rate_rad_s: 0}");
/// assert!(decode(&Twist::schema(), &bytes[1..]).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Data: Serialize + DeserializeOwned + Schema + 'static {}

impl<T: Serialize + DeserializeOwned + Schema + 'static> Data for T {}

/// Data with a form that borrows its byte fields where they lie, so that reading it copies none of them. The bytes are
/// the same: a field of type [`Bytes`] or `Vec<u8>` is a `&[u8]` there, and a text a `&str`.
///
/// ```
/// use rohrpost_schema::{Bytes, Schema, View};
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Serialize, Deserialize, Schema)]
/// struct Frame { width_px: u32, pixels: Bytes }
///
/// #[derive(Deserialize)]
/// struct FrameView<'a> { width_px: u32, pixels: &'a [u8] }
///
/// impl View for Frame { type View<'a> = FrameView<'a>; }
///
/// let bytes = postcard::to_stdvec(&Frame { width_px: 2, pixels: vec![7, 9].into() })?;
/// let view: FrameView<'_> = postcard::from_bytes(&bytes)?;
/// assert_eq!((view.width_px, view.pixels), (2, &bytes[2..]));
/// # Ok::<(), postcard::Error>(())
/// ```
pub trait View: Data {
    /// The form that borrows.
    type View<'a>: Deserialize<'a>;
}
