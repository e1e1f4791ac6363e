//! Streams of other modules, looked at when the module likes.

use rohrpost_mailbox::{Around, Missed, Next, RecordInfo};
use rohrpost_modules::runtime::{Moment, Record, StayingBytes, Stream, StreamReadError};
use rohrpost_schema::DataItem;
use std::time::Duration;

/// A stream of another module, with a position of its own.
pub struct NativeStream {
    /// Name, number and type.
    pub item: DataItem,
    stream: Stream<()>,
}

/// A record in hand: it stays held until its stream reads another one.
pub struct StayingRecord {
    /// Sequence, stamp, when it was written.
    pub info: RecordInfo,
    /// The value, postcard of the type that the description says; nobody has looked whether it is.
    pub bytes: StayingBytes,
}

impl From<Record<'_, ()>> for StayingRecord {
    fn from(record: Record<'_, ()>) -> Self {
        let (info, bytes) = record.stay();
        Self { info, bytes }
    }
}

impl NativeStream {
    pub(crate) fn new(item: DataItem, stream: Stream<()>) -> Self {
        Self { item, stream }
    }

    /// The newest record; none before the first. The position stays.
    ///
    /// # Errors
    /// The stream cannot be read, or is of another interface.
    pub fn newest(&mut self) -> Result<Option<StayingRecord>, StreamReadError> {
        Ok(self.stream.newest()?.map(StayingRecord::from))
    }

    /// The next record, or how many were lost; the first time the first one written after the stream was opened. Waits
    /// at most so long, and all else of the module with it.
    ///
    /// # Errors
    /// As for [`NativeStream::newest`].
    pub fn next_within(&mut self, timeout: Duration) -> Result<Next<StayingRecord>, StreamReadError> {
        let next = if timeout.is_zero() { self.stream.try_next() } else { self.stream.next_within(timeout) };
        Ok(next?.map(StayingRecord::from))
    }

    /// The record of this sequence; none when it is there no more, or not yet. The position stays.
    ///
    /// # Errors
    /// As for [`NativeStream::newest`].
    pub fn record(&mut self, sequence: u64) -> Result<Option<StayingRecord>, StreamReadError> {
        Ok(self.stream.record(sequence)?.map(StayingRecord::from))
    }

    /// The two records around a time, or exactly why not.
    ///
    /// # Errors
    /// As for [`NativeStream::newest`].
    pub fn around(&mut self, at: Moment) -> Result<Around, StreamReadError> {
        self.stream.around(at)
    }

    /// Records lost on the way, by cause.
    pub fn missed(&self) -> Missed {
        self.stream.missed()
    }
}
