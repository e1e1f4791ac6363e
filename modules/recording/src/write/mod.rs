//! Writing one file: records as bytes, chunks, the index at the end.
//!
//! ```text
//! OpenFile ──definitions, messages──▶ OpenChunk ──packed──▶ Output ──▶ file
//!         └──what is where─────────▶ Summary ────at its end──┘
//! ```
//!
//! `mcap` writes each definition once, in the first chunk that uses it. Here chunks repeat them ([`file`]), so that no
//! damage to one chunk makes others unreadable.

mod chunk;
pub(crate) mod file;
mod output;
pub(crate) mod records;
mod summary;
