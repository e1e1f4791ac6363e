//! Streams: rings of stamped records in shared memory, each with one writer and many readers. `ring` tells how.
//!
//! Reading order: `ring`, `writing`, `lookup` are the protocol; `shape`, `segment`, `bytes` the memory; `writer`,
//! `reader`, `record`, `error` what users hold; `files` which there are; `inspect` what each says of itself.

mod bytes;
mod error;
mod files;
mod inspect;
mod lookup;
mod reader;
mod record;
mod ring;
mod segment;
mod shape;
mod writer;
mod writing;

pub use error::{StreamError, WriteError};
pub use inspect::StreamInfo;
pub use reader::StreamReader;
pub use record::{Around, HeldRecord, Next, RecordInfo};
pub use ring::{STREAM_READERS_MAX, Stamp};
pub use shape::{STREAM_KEEP_MAX, StreamId, StreamShape, StreamShapeError};
pub use writer::{OpenRecord, StreamWriter};
