//! What goes wrong on the disk and in files.

use crate::format::{DESCRIBED_BYTES_MAX, HELD_BYTES_MAX, RECORD_BYTES_MAX};
use rohrpost_schema::plain::{self, ForeignText};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// What the disk does not do. Recording goes on with a new file as soon as one can be written.
#[derive(Clone, Debug, Error)]
pub enum DiskError {
    /// Not a byte more, or not for this user.
    #[error("{path}: the disk or the user's quota is full; delete recordings, or record to another disk (df {path})")]
    Full {
        /// The file that was written.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: Arc<io::Error>,
    },
    /// Less is free than recordings leave to others.
    #[error(
        "{folder}: {free_bytes} bytes are free, and recordings leave {leave_bytes}; delete recordings, or record to \
         another disk"
    )]
    Low {
        /// Where recordings are.
        folder: Shown,
        /// Free for this user.
        free_bytes: u64,
        /// To be left.
        leave_bytes: u64,
    },
    /// Mounted without writing, perhaps by the kernel after an error.
    #[error("{path}: the file system is read-only; see `dmesg` for an error of the disk, and mount it for writing")]
    ReadOnly {
        /// What was to be written.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: Arc<io::Error>,
    },
    /// By the modes of the folder or its file system.
    #[error("{path}: permission denied; let the user of the recorder write in this folder")]
    Denied {
        /// What was to be written.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: Arc<io::Error>,
    },
    /// The folder or the open file was removed, or its disk unmounted.
    #[error("{path}: is gone; make the folder again, or mount its disk")]
    Gone {
        /// What is not there.
        path: Shown,
        /// What the kernel said, if it was asked for that.
        #[source]
        error: Option<Arc<io::Error>>,
    },
    /// A link leads to where no files are to be made.
    #[error("{folder}: leads out of {root}, where files are to be made; remove the link")]
    Outside {
        /// Where recordings are.
        folder: Shown,
        /// Where they may be.
        root: Shown,
    },
    /// What was written may not be on the disk.
    #[error("{path}: sync failed, what was written since the last sync may be lost: {error}")]
    Sync {
        /// The file.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: Arc<io::Error>,
    },
    /// Anything else.
    #[error("{path}: cannot {doing}: {error}")]
    Other {
        /// What was tried.
        doing: &'static str,
        /// With which file.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: Arc<io::Error>,
    },
}

impl DiskError {
    /// Sorts an error of the kernel.
    pub(crate) fn new(doing: &'static str, path: &Path, error: io::Error) -> Self {
        let (path, error) = (Shown(path.to_owned()), Arc::new(error));
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full { path, error },
            io::ErrorKind::ReadOnlyFilesystem => Self::ReadOnly { path, error },
            io::ErrorKind::PermissionDenied => Self::Denied { path, error },
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Self::Gone { path, error: Some(error) },
            _ => Self::Other { doing, path, error },
        }
    }
}

/// Why there is no new file.
#[derive(Debug, Error)]
pub enum RewriteError {
    /// Nothing is overwritten.
    #[error("{0}: is there already; remove it, or name another file")]
    Exists(Shown),
    /// The disk does not take it.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// A path in a message, in its line as [`ForeignText`] is: names of files may come from others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown(pub PathBuf);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&plain::line(&self.0.to_string_lossy()))
    }
}

/// Why a file cannot be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The kernel does not let it.
    #[error("{path}: cannot read: {error}")]
    Io {
        /// The file.
        path: Shown,
        /// What the kernel said.
        #[source]
        error: io::Error,
    },
    /// It does not begin with MCAP's magic bytes.
    #[error("{path}: is no MCAP file; name a file of a recording (*.mcap)")]
    NotMcap {
        /// The file.
        path: Shown,
    },
    /// It was not closed: its writer was killed or still writes, or the end is cut off.
    #[error("{path}: was not closed, so it has no index; if nothing writes it any more, `recover` makes a whole file")]
    NotClosed {
        /// The file.
        path: Shown,
    },
    /// Something in it contradicts itself.
    #[error("{path}: damaged at byte {at}: {what}; `recover` makes a file of what is readable")]
    Damaged {
        /// The file.
        path: Shown,
        /// Where in the file.
        at: u64,
        /// What is wrong.
        what: Damage,
    },
    /// It may be whole, and is more than is read here.
    #[error("{path}: {limit}")]
    TooMuch {
        /// The file.
        path: Shown,
        /// Of what.
        limit: FileLimit,
    },
}

/// What of a file is more than is read here. The file need not be damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FileLimit {
    /// Descriptions of types, channels and modules.
    #[error(
        "what it describes (types, channels, modules, metadata) takes more than {} MiB of memory, which is the limit; \
         record fewer topics in a file",
        DESCRIBED_BYTES_MAX >> 20
    )]
    Described,
    /// A record of the file.
    #[error("a record of {0} bytes; records of up to {mib} MiB are read", mib = RECORD_BYTES_MAX >> 20)]
    Record(u64),
    /// A chunk, before compression.
    #[error(
        "a chunk of {0} bytes before compression; chunks of up to {mib} MiB are read: have them written smaller",
        mib = RECORD_BYTES_MAX >> 20
    )]
    Chunk(u64),
    /// Messages that are so far out of order that too many wait for their turn.
    #[error(
        "its messages are so far out of order that more than {} MiB of them would wait for their turn, which is the \
         limit; sort it (`mcap sort`), or play a part of it",
        HELD_BYTES_MAX >> 20
    )]
    Disorder,
}

/// How a part of a file is damaged.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Damage {
    /// The file ends inside of a record.
    #[error("the file ends inside of a record")]
    Cut,
    /// A byte of what each file begins with.
    #[error("the file does not begin as an MCAP file does, but for one byte")]
    Magic,
    /// More than is read here: it may be whole.
    #[error(transparent)]
    Limit(FileLimit),
    /// A record that MCAP does not have, or that does not end where it says.
    #[error("no record begins here (type {op}, {len} bytes)")]
    NoRecord {
        /// Its first byte.
        op: u8,
        /// Its length.
        len: u64,
    },
    /// The bytes of a record do not say what such a record says.
    #[error("a record of type {op} that cannot be read")]
    Record {
        /// Its first byte.
        op: u8,
    },
    /// Checked by sum.
    #[error("the checksum of a chunk is wrong")]
    ChunkSum,
    /// Checked by sum.
    #[error("the checksum of the summary is wrong")]
    SummarySum,
    /// Checked by sum.
    #[error("the checksum of an attachment is wrong")]
    AttachmentSum,
    /// Bytes that do not unpack.
    #[error("a chunk cannot be decompressed")]
    Compression,
    /// Written by another program.
    #[error("a chunk is compressed by `{0}`; zstd and lz4 are read here")]
    ForeignCompression(ForeignText),
    /// Its channel is not described before it.
    #[error("a message of channel {0}, which is not described")]
    UnknownChannel(u16),
    /// Its schema is not described before it.
    #[error("a channel of schema {0}, which is not described")]
    UnknownSchema(u16),
    /// Described twice, and not in the same way.
    #[error("channel or schema {0} is described twice, differently")]
    Redefined(u16),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MergeError, SelectError};
    use rohrpost_schema::plain::is_obeyed;

    #[test]
    fn texts_of_files_stay_in_their_line() {
        let text = || ForeignText::from("x\u{1b}[2J\u{202e}\nFORGED: all is well");
        let path = || Shown(PathBuf::from(text().as_str()));
        let what = Damage::ForeignCompression(text());
        let merge = MergeError::OtherType {
            topic: text(),
            first: path(),
            first_type: text(),
            second: path(),
            second_type: text(),
        };
        for told in [
            ReadError::Damaged { path: path(), at: 7, what }.to_string(),
            merge.to_string(),
            SelectError::NoName { name: "scan".into(), there: vec![text(), text()] }.to_string(),
        ] {
            assert!(!told.contains(is_obeyed) && told.contains(r"x\u001b[2J\u202e\nFORGED"), "{told}");
        }
    }
}
