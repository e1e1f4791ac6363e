//! Why a node could not be used.

use crate::memory::files::existing;
use crate::memory::files::{Unfit, is_lack_of_descriptors, is_lack_of_memory};
use crate::memory::layout::VERSION;
use crate::node::entry::PARTICIPANTS_MAX;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Changing the registry takes microseconds; a process that holds it longer is stopped.
pub(crate) const REGISTRY_PATIENCE: Duration = Duration::from_secs(2);

/// Why a node's directory could not be used.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The system said no.
    #[error("node directory {0}: {1}")]
    Io(PathBuf, #[source] io::Error),
    /// Another user put it there, or could have.
    #[error(
        "node directory {0} belongs to user {1}, not to us, and is left alone; have that user or root remove it, or \
         set ROHRPOST_DIR to another place"
    )]
    Foreign(PathBuf, u32),
    /// Another version's layout.
    #[error(
        "node {0} was made by another version of Rohrpost (layout {1}, this program has {VERSION}); use the \
         `rohrpost` that launched it, or stop what runs there and remove the directory"
    )]
    Version(PathBuf, u32),
    /// No memory, most likely.
    #[error("node {path}: no shared memory: {source}; is it full (df {})?", existing(path).display())]
    Memory {
        /// Its directory.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// As many files are open as may be.
    #[error(
        "node {0}: this process, or the computer, has no file descriptor left; raise the limit (ulimit -n, or \
         LimitNOFILE= of a service)"
    )]
    Descriptors(PathBuf),
    /// Another user's.
    #[error(
        "node {0}: permission denied; be the user that owns the node, or have its `mode` in the configuration let \
         you in"
    )]
    Denied(PathBuf),
    /// Cut off, or somebody else's.
    #[error("node {0}: its file `node` is damaged, or not Rohrpost's; stop what runs there and remove the directory")]
    Damaged(PathBuf),
    /// No such node, or it was removed after it was opened.
    #[error("no node at {0}: is it launched?")]
    Missing(PathBuf),
    /// Nothing free in the table.
    #[error("node {0} has {PARTICIPANTS_MAX} participants already; end some, or spread them over nodes")]
    Crowded(PathBuf),
    /// Somebody stopped while changing the registry.
    #[error("node {0}: the registry has been locked for {REGISTRY_PATIENCE:?}; is a process there stopped or traced?")]
    Busy(PathBuf),
    /// It runs already.
    #[error("node {0} is launched already, by process {1}; stop that one first")]
    Launched(PathBuf, u32),
}

impl NodeError {
    /// What the system said of a file of the node's.
    pub(crate) fn of(path: &Path, source: io::Error) -> Self {
        if let Some(Unfit::Foreign(path, owner)) = Unfit::of(&source) {
            return Self::Foreign(path.clone(), *owner);
        }
        match &source {
            error if is_lack_of_memory(error) => Self::Memory { path: path.into(), source },
            error if error.kind() == io::ErrorKind::PermissionDenied => Self::Denied(path.into()),
            error if is_lack_of_descriptors(error) => Self::Descriptors(path.into()),
            _ => Self::Io(path.into(), source),
        }
    }

    /// What the system said of the file `node`, or of its directory: without them there is no node.
    pub(crate) fn of_node(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::Missing(path.into()),
            _ if Unfit::is_kind(&source) => Self::Damaged(path.into()),
            _ => Self::of(path, source),
        }
    }
}
