//! Streams: rings of stamped records in shared memory, each with one writer and many readers. `ring` tells how.
//!
//! Reading order: `ring`, `writing`, `omission`, `left_out`, `missed`, `lookup` are the protocol; `shape`, `segment`,
//! `bytes` the memory; `writer`, `replica`, `reader`, `record`, `place`, `error` what users hold; `files` which there
//! are; `inspect` what each says of itself.

mod bytes;
mod error;
mod files;
mod inspect;
mod left_out;
mod lookup;
mod missed;
mod omission;
mod place;
mod reader;
mod record;
mod replica;
mod ring;
mod segment;
mod shape;
mod writer;
mod writing;

pub use error::{ReplicaError, StreamError, WriteError};
pub use inspect::StreamInfo;
pub use missed::Missed;
pub use place::RecordPlace;
pub use reader::StreamReader;
pub use record::{Around, HeldRecord, Next, RecordInfo};
pub use replica::{OriginRecord, ReplicaWriter};
pub use ring::{SEQUENCE_MAX as STREAM_SEQUENCE_MAX, STREAM_READERS_MAX, Stamp};
pub use shape::{STREAM_KEEP_MAX, StreamId, StreamShape, StreamShapeError};
pub use writer::{OpenRecord, StreamWriter, SuspendedRecord};
