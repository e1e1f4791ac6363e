//! Why a stream could not be had, and why a record was not written.

use crate::memory::files::{is_lack_of_descriptors, is_lack_of_memory};
use crate::memory::owned::{BadFile, BadSegment};
use crate::name::Name;
use crate::node::error::NodeError;
use crate::stream::shape::{StreamId, StreamShapeError};
use std::io;
use std::path::{Path, PathBuf};

/// Why a stream could not be made, or opened to read.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// Reserved parts.
    #[error("stream {0}: system and class 0 and system 255 are reserved")]
    Reserved(StreamId),
    /// Impossible shape.
    #[error("stream {0}: {1}")]
    Shape(StreamId, StreamShapeError),
    /// Somebody writes there.
    #[error(
        "stream {id} is written by {module}, process {pid}; a stream has one writer: stop that process, or use another \
         instance"
    )]
    Owned {
        /// The stream.
        id: StreamId,
        /// The module that writes, as it joined; [`Name::NONE`] for one without a name.
        module: Name,
        /// Its process.
        pid: u32,
    },
    /// All seats are taken.
    #[error("stream {id} has {readers} readers already; end one, or raise its `readers`")]
    Crowded {
        /// The stream.
        id: StreamId,
        /// How many it may have.
        readers: u16,
    },
    /// No memory, most likely.
    #[error(
        "stream {id}: {bytes} bytes of shared memory: {source}; is it full (df {})?",
        crate::memory::files::existing(.node).display()
    )]
    Memory {
        /// The stream.
        id: StreamId,
        /// How much it needs.
        bytes: usize,
        /// The node's directory.
        node: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// As many files are open as may be.
    #[error(
        "stream {0}: this process, or the computer, has no file descriptor left, and each stream that a process uses \
         takes one; raise the limit (ulimit -n, or LimitNOFILE= of a service), or use several processes"
    )]
    Descriptors(StreamId),
    /// Its file cannot be used.
    #[error("stream {0}: its file {1}: {2}")]
    File(StreamId, PathBuf, #[source] io::Error),
    /// Its file is something else.
    #[error("stream {0}: {1}")]
    Bad(StreamId, BadFile),
    /// The node cannot be used.
    #[error(transparent)]
    Node(#[from] NodeError),
}

impl StreamError {
    /// What the system said of a stream's file, which lies in the node's directory.
    pub(crate) fn of(file: &Path, id: StreamId, bytes: usize, source: io::Error) -> Self {
        if is_lack_of_memory(&source) {
            return Self::Memory { id, bytes, node: file.parent().unwrap_or(file).into(), source };
        }
        if is_lack_of_descriptors(&source) {
            return Self::Descriptors(id);
        }
        Self::File(id, file.into(), source)
    }

    pub(crate) fn of_bad(file: &Path, id: StreamId, why: BadSegment) -> Self {
        match why {
            BadSegment::Io(source) => Self::of(file, id, 0, source),
            BadSegment::File(why) => Self::Bad(id, why),
        }
    }
}

/// Why a record was not written. The stream is as it was.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WriteError {
    /// Larger than the stream's records.
    #[error("stream {id} takes records of at most {max} bytes, this one has {len}; raise its `record`")]
    TooLarge {
        /// The stream.
        id: StreamId,
        /// Bytes of the record.
        len: usize,
        /// Bytes that fit.
        max: usize,
    },
    /// Stamps start at 1.
    #[error("stream {0}: a record without a stamp; its time of production is never 0")]
    Unstamped(StreamId),
    /// The stamp is too far behind. Counted.
    #[error(
        "stream {id}: the stamp is {behind_ns} ns behind the newest, {late_ns} are allowed; write in order, or raise \
         its `late`"
    )]
    Late {
        /// The stream.
        id: StreamId,
        /// How far behind.
        behind_ns: u64,
        /// How far it may be.
        late_ns: u64,
    },
    /// The stamp is of an epoch that has ended. Counted.
    #[error("stream {id}: the stamp is of epoch {epoch}, and records of epoch {newest} were written already")]
    OldEpoch {
        /// The stream.
        id: StreamId,
        /// The stamp's.
        epoch: u64,
        /// The newest record's.
        newest: u64,
    },
    /// A foreign program wrote into the readers' pages or the index.
    #[error("stream {0}: its index is damaged; end its users, and remove its file with `rohrpost clean`")]
    Damaged(StreamId),
}

/// Why a record of a replica was not begun, or not finished. The stream is as it was.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReplicaError {
    /// It has come to a later one already.
    #[error("stream {id}: a replica has passed record {sequence}; the next is {next} at the least")]
    Passed {
        /// The stream.
        id: StreamId,
        /// The record's.
        sequence: u64,
        /// The least that it may be.
        next: u64,
    },
    /// There is no room for it beside what is begun: as many records as may be are, or readers hold all other frames.
    #[error("stream {0}: there is no room for a record beside those that are begun; finish or give up one")]
    Begun(StreamId),
    /// As for any stream.
    #[error(transparent)]
    Write(#[from] WriteError),
}
