//! Which streams a node has, and removing those that nobody writes.

use crate::memory::owned;
use crate::node::directory::{Node, RegistryLock};
use crate::node::error::{NodeError, REGISTRY_PATIENCE};
use crate::step::step;
use crate::stream::segment::{StreamSegment, file_name, id_of};
use crate::stream::shape::StreamId;
use std::time::Duration;

impl Node {
    /// All streams of the node, in order.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn streams(&self) -> Result<Vec<StreamId>, NodeError> {
        let failed = |error| NodeError::Io(self.path().into(), error);
        let files = self.directory().names().map_err(failed)?;
        let mut streams: Vec<_> = files.filter_map(|file| id_of(&file)).collect();
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
        let _registry = RegistryLock::take_within(self.directory(), patience)?;
        owned::remove_orphan::<StreamSegment>(self, id, || {
            let file = file_name(id);
            self.directory().remove(&file).map_err(|error| NodeError::Io(self.path().join(file), error))?;
            step!("unlink: ring gone");
            self.raise_registry_epoch();
            Ok(())
        })
    }
}
