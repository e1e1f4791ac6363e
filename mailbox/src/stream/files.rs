//! Which streams a node has, and removing those that nobody writes.

use crate::node::{Node, NodeError, REGISTRY_PATIENCE, RegistryLock};
use crate::owned;
use crate::step::step;
use crate::stream::segment::{StreamSegment, id_of, path_of};
use crate::stream::shape::StreamId;
use std::fs;
use std::time::Duration;

impl Node {
    /// All streams of the node, in order.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn streams(&self) -> Result<Vec<StreamId>, NodeError> {
        let failed = |error| NodeError::Io(self.path().into(), error);
        let entries = fs::read_dir(self.path()).map_err(failed)?;
        let mut streams: Vec<_> = entries.filter_map(|entry| id_of(&entry.ok()?.path())).collect();
        streams.sort();
        Ok(streams)
    }

    /// Removes a stream that nobody writes; false when somebody does, or it is gone. Its readers keep what is there,
    /// and follow when it is made anew.
    ///
    /// # Errors
    /// When the node's directory cannot be changed.
    pub fn remove_orphan_stream(&self, id: StreamId) -> Result<bool, NodeError> {
        self.remove_orphan_stream_within(id, REGISTRY_PATIENCE)
    }

    /// The same for a thread that others wait for: while another process has the registry, it waits for so long only.
    ///
    /// # Errors
    /// When the node's directory cannot be changed.
    pub fn remove_orphan_stream_within(&self, id: StreamId, patience: Duration) -> Result<bool, NodeError> {
        let _registry = RegistryLock::take_within(self.path(), patience)?;
        owned::remove_orphan::<StreamSegment>(self, id, || {
            let path = path_of(self.path(), id);
            fs::remove_file(&path).map_err(|error| NodeError::Io(path, error))?;
            step!("unlink: ring gone");
            self.raise_registry_epoch();
            Ok(())
        })
    }
}
