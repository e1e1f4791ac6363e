//! What launch knows of its modules, in a file of the node's directory: readers of the node need no call.

use super::{ChildState, LauncherInterface};
use rohrpost_mailbox::Node;
use std::fs;
use std::path::PathBuf;

/// In a node's directory: four bytes that tell forms apart, then postcard of the states.
const FILE: &str = "children";

/// Remembers what was written last: only what has changed is written.
#[derive(Default)]
pub(crate) struct Known {
    written: Option<Vec<ChildState>>,
}

impl Known {
    /// Writes it, whole, if it has changed. A full /dev/shm is no reason not to look after modules: then it is tried
    /// again.
    pub(crate) fn write(&mut self, node: &Node, mut states: Vec<ChildState>) {
        // It changes all the time; a tool that wants it asks.
        states.iter_mut().for_each(|state| state.starts_in_ms = None);
        if self.written.as_ref() == Some(&states) {
            return;
        }
        let unfinished = path(node).with_extension("new");
        let mut bytes = form().to_vec();
        // Writing to a growing vector does not fail.
        bytes.extend(postcard::to_stdvec(&states).unwrap_or_default());
        let written = fs::write(&unfinished, bytes).and_then(|()| fs::rename(&unfinished, path(node)));
        self.written = written.is_ok().then_some(states);
    }
}

/// What the launch of this node knows; nothing when none runs, or it is of another version.
pub(crate) fn read(node: &Node) -> Vec<ChildState> {
    if node.launcher().is_none() {
        return Vec::new();
    }
    let bytes = fs::read(path(node)).unwrap_or_default();
    let states = bytes.strip_prefix(&form()).and_then(|states| postcard::from_bytes(states).ok());
    states.unwrap_or_default()
}

fn path(node: &Node) -> PathBuf {
    node.path().join(FILE)
}

/// Computed from the types, as is the hash of launch's interface, which has them too.
fn form() -> [u8; 4] {
    LauncherInterface::hash().to_le_bytes()
}
