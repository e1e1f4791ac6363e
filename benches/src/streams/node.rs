//! A node with one stream, and what its readers and writer say.

use rohrpost_bench_local::harness::{Failure, Scratch};
use rohrpost_bench_local::ours::join;
use rohrpost_mailbox::{
    Name, Next, Participant, Stamp, StreamError, StreamId, StreamReader, StreamShape, StreamWriter,
};
use std::sync::Arc;

const ID: StreamId = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };

/// A node of its own in shared memory, for one stream; gone when this is dropped.
pub struct StreamNode {
    scratch: Scratch,
    shape: StreamShape,
}

impl StreamNode {
    /// Makes the directory; the processes of a turn make the rest.
    ///
    /// # Errors
    /// When there is no room.
    pub fn new(shape: StreamShape) -> Result<Self, Failure> {
        Ok(Self { scratch: Scratch::new()?, shape })
    }

    fn participant(&self) -> Result<Arc<Participant>, Failure> {
        join(&self.scratch.directory().join("node"), Name::NONE)
    }

    /// Makes the stream.
    ///
    /// # Errors
    /// When there is no memory for it, or somebody writes there.
    pub fn writer(&self) -> Result<StreamWriter, Failure> {
        self.participant()?.stream_writer(ID, self.shape).map_err(stream_failure)
    }

    /// Opens the stream, which may come later.
    ///
    /// # Errors
    /// When all seats are taken.
    pub fn reader(&self) -> Result<StreamReader, Failure> {
        self.participant()?.stream_reader(ID).map_err(stream_failure)
    }

    /// Opens readers one after the other, all of one participant.
    ///
    /// # Errors
    /// When the node cannot be joined.
    pub fn readers(&self) -> Result<impl Fn() -> Result<StreamReader, Failure>, Failure> {
        let participant = self.participant()?;
        Ok(move || participant.stream_reader(ID).map_err(stream_failure))
    }
}

/// Why a stream could not be had. Too little shared memory is the computer's doing.
pub fn stream_failure(error: StreamError) -> Failure {
    match error {
        StreamError::Memory { .. } => Failure::Skipped(error.to_string()),
        error => Failure::of("stream", error),
    }
}

/// The stamp of a record: one nanosecond for each. What a stamp is makes no difference to what is measured.
pub fn stamp(sequence: u64) -> Stamp {
    Stamp { epoch: 1, ns: sequence + 1 }
}

/// The record, which must have come.
///
/// # Errors
/// When there is none, or the reader has lost some.
pub fn came<T>(next: Result<Next<T>, StreamError>) -> Result<T, Failure> {
    match next.map_err(stream_failure)? {
        Next::Record(record) => Ok(record),
        Next::Lost(lost) => Err(Failure::Failed(format!("{lost} records are lost"))),
        Next::Nothing => Err(Failure::Failed("a record is not there that was written".into())),
    }
}
