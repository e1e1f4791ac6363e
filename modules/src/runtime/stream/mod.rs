//! Streams of a module: those that it writes, and those of other modules that it reads.
//!
//! ```text
//!            encode: into the record                ┌─▶ subscribers, `get data` (publish)
//! value ──▶ OpenValue ──▶ record of the ring ───────┤
//!                              │                    └─▶ counted as published
//!                              ├─▶ Stream: looked at when the module likes
//!                              └─▶ FollowedStream: each record, by `Module::received`
//! ```

mod check;
mod encode;
mod error;
mod follow;
mod moment;
mod noted;
mod open;
mod own;
mod read;
mod record;

pub(super) use check::{CheckedReader, KnownStream};
pub use error::{RecordError, StreamReadError};
pub(super) use follow::Step;
pub use follow::StreamSubscription;
pub(crate) use follow::{FollowedStream, FollowedStreams};
pub use moment::Moment;
pub(super) use noted::{note, opened};
pub use open::{OpenValue, SuspendedValue};
pub(crate) use own::{OwnStream, OwnStreams, StreamItem};
pub(super) use own::{ServedStreams, is_new, make, remove};
pub use read::Stream;
pub use record::{Record, StayingBytes};
