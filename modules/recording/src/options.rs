//! What a recording is told at its start.

use crate::disk::FILE_MODE;
use crate::drawn::DrawnBeside;
use crate::rotate::Rotation;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

/// How a recording is written.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where its files are; it must exist.
    pub folder: PathBuf,
    /// Files are made here and below only, wherever links lead; looked at for each file. None: anywhere.
    pub root: Option<PathBuf>,
    /// Permissions of each file, whatever the umask says.
    pub mode: u32,
    /// How their names begin: `STEM-0001.mcap`.
    pub stem: String,
    /// When the next file begins.
    pub rotation: Rotation,
    /// A message waits no longer in memory for others to fill its chunk: so much is lost if the recorder is killed.
    pub flush: Duration,
    /// How often the disk is told to keep what it has: so much is lost with the power.
    pub sync: Duration,
    /// How long to wait after an error of the disk before the next try.
    pub retry: Duration,
    /// What stays free on the disk.
    pub leave_bytes: u64,
    /// Room for so many chunks of a megabyte, which wait in memory while the disk is slow. A channel takes half of it
    /// at most, and never more than is free then; what finds no room is lost, and counted.
    pub queue_chunks: usize,
    /// What other programs draw is in the same files.
    pub drawn: Option<DrawnBeside>,
}

impl Options {
    /// The usual ones.
    pub fn new(folder: impl Into<PathBuf>, stem: impl Into<String>) -> Self {
        Self {
            folder: folder.into(),
            root: None,
            mode: FILE_MODE,
            stem: stem.into(),
            rotation: Rotation::default(),
            flush: Duration::from_millis(500),
            sync: Duration::from_secs(2),
            retry: Duration::from_secs(1),
            leave_bytes: 256 << 20,
            queue_chunks: 64,
            drawn: None,
        }
    }
}

/// What each file of a recording says about it.
#[derive(Clone, Debug, Default)]
pub struct Session {
    /// The node that records.
    pub node: String,
    /// Programs and their versions.
    pub versions: BTreeMap<String, String>,
    /// Texts of the configuration, by file name.
    pub configuration: BTreeMap<String, String>,
}
