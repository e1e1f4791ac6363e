//! Values within entries: whole, or by their sums.

use super::bytes::Blob;
use super::records::RecordSum;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// A longer value is noted by its length and sum: what the module sends, and records that are recorded anyhow.
pub const WHOLE_BYTES_MAX: usize = 4096;
/// Bytes of a value without description that are shown.
const SHOWN_BYTES: usize = 64;

/// A value: whole, if it is not long.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(crate) enum NotedValue<'a> {
    Whole(#[serde(borrow)] Blob<'a>),
    Sum(RecordSum),
}

impl<'a> NotedValue<'a> {
    pub(crate) fn of(bytes: &'a [u8]) -> Self {
        match bytes.len() {
            0..=WHOLE_BYTES_MAX => Self::Whole(Blob(bytes)),
            _ => Self::Sum(RecordSum::of(bytes)),
        }
    }

    /// In words; `decoded` knows its type, perhaps.
    pub(super) fn shown(&self, decoded: impl FnOnce(&[u8]) -> Option<String>) -> String {
        match self {
            Self::Whole(bytes) => decoded(bytes.0).unwrap_or_else(|| in_hex(bytes.0)),
            Self::Sum(sum) => sum.to_string(),
        }
    }
}

/// Bytes of which the type is not known.
pub(super) fn in_hex(bytes: &[u8]) -> String {
    let mut text = format!("{} bytes", bytes.len());
    for (at, byte) in bytes.iter().take(SHOWN_BYTES).enumerate() {
        // Writing to a text does not fail.
        let _ = write!(text, "{}{byte:02x}", if at % 4 == 0 { " " } else { "" });
    }
    if bytes.len() > SHOWN_BYTES {
        text.push_str(" …");
    }
    text
}
