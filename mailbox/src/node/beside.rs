//! Files that lie beside the mailboxes, for every process of the node to read: whole, and of words that this crate does
//! not know.

use crate::node::directory::Node;
use crate::node::error::NodeError;
use std::io;

/// What a file is called while its one writer writes it.
pub(crate) fn unfinished(name: &str) -> String {
    format!("{name}.new")
}

impl Node {
    /// Writes a file of the node's directory, in place of one of this name. It appears whole, and the users that the
    /// node's mode lets in may use it. A file has one writer at a time.
    ///
    /// # Errors
    /// When it cannot be written; what was there before stays.
    pub fn put_file(&self, name: &str, bytes: &[u8]) -> Result<(), NodeError> {
        let put = self.directory().put(name, &unfinished(name), bytes);
        put.map_err(|error| NodeError::of(&self.path().join(name), error))
    }

    /// Reads a file of the node's directory; `None` if there is none. Another process wrote it, so check it.
    ///
    /// ```
    /// use rohrpost_mailbox::Node;
    ///
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// node.put_file("notes", b"calibrated")?;
    /// assert_eq!(node.read_file("notes")?.as_deref(), Some(&b"calibrated"[..]));
    /// assert_eq!(node.read_file("others")?, None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When it cannot be read, is longer than 1 MiB, or is no file of a user that may write there.
    pub fn read_file(&self, name: &str) -> Result<Option<Vec<u8>>, NodeError> {
        match self.directory().read(name) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(NodeError::of(&self.path().join(name), error)),
        }
    }
}
