//! Streams: rings of stamped records, written and read in place.

mod read;
mod write;

pub use read::{
    ReaderHandle, Record, RecordAbout, RecordsAround, RecordsMissed, rohrpost_stream_around, rohrpost_stream_missed,
    rohrpost_stream_newest, rohrpost_stream_next, rohrpost_stream_reader_close, rohrpost_stream_reader_open,
    rohrpost_stream_reader_release, rohrpost_stream_record,
};
pub use write::{
    WriterHandle, rohrpost_stream_abandon, rohrpost_stream_begin, rohrpost_stream_finish, rohrpost_stream_write,
    rohrpost_stream_writer_close, rohrpost_stream_writer_open,
};

use rohrpost_mailbox::{Name, Stamp, StreamId, StreamShape};
use std::time::Duration;

/// Which stream: the name of the module that writes it, and the number that its interface gives it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct StreamNumber {
    /// The module.
    pub name: u32,
    /// The number.
    pub number: u16,
}

/// When a record was produced, by system time.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RecordStamp {
    /// Stamps of different epochs cannot be subtracted.
    pub epoch: u64,
    /// Nanoseconds since 1970; not 0.
    pub ns: u64,
}

/// What a stream is asked to be. `ROHRPOST_STREAM_DEFAULT` is one.
#[repr(C)]
pub struct RingShape {
    /// Largest record, bytes.
    pub record_bytes: u32,
    /// Records that are kept, at least 2.
    pub keep: u32,
    /// Most readers at a time, 1 to 64.
    pub readers: u16,
    /// How far behind the newest a stamp may be, ns.
    pub late_ns: u64,
}

fn id(stream: StreamNumber) -> StreamId {
    StreamId { name: Name::from_raw(stream.name), number: stream.number }
}

fn stamp(stamp: RecordStamp) -> Stamp {
    Stamp { epoch: stamp.epoch, ns: stamp.ns }
}

fn shape(shape: &RingShape) -> StreamShape {
    let RingShape { record_bytes, keep, readers, late_ns } = *shape;
    StreamShape { record_bytes, keep, readers, late: Duration::from_nanos(late_ns) }
}
