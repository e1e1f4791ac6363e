//! Reading files: whole, cut and damaged ones, with one chunk in memory at a time; a replay has some more.
//!
//! ```text
//! Frames ──record by record──▶ chunk::unpack ──▶ Contents ──messages, metadata, damage──▶ recover, merge, info
//!        └────── ReadAhead, a thread ──────┘
//!        └─from the end──────▶ Index ──which chunk is where──▶ Selected ──▶ cut, draw, Reader
//! ```
//!
//! `mcap` parses records. Framing and chunks are done here: its readers stop at the first damaged chunk, and trust a
//! chunk's header, which no checksum protects. Lengths are bounded before anything is allocated for them, and what is
//! kept of a file is counted (`cost`).

pub(crate) mod ahead;
pub(crate) mod attachment;
pub(crate) mod before;
pub(crate) mod chunk;
pub(crate) mod contents;
pub(crate) mod cost;
pub(crate) mod definitions;
pub(crate) mod frames;
pub(crate) mod index;
pub(crate) mod last;
pub(crate) mod ordered;
pub(crate) mod outline;
pub(crate) mod resync;
pub(crate) mod selected;
