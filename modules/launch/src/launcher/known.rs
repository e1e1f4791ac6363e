//! What launch knows of its modules, in a file of the node's directory: readers of the node need no call.

use super::{ChildState, LauncherInterface};
use rohrpost_mailbox::Node;

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
        let mut bytes = form().to_vec();
        // Writing to a growing vector does not fail.
        bytes.extend(postcard::to_stdvec(&states).unwrap_or_default());
        self.written = node.put_file(FILE, &bytes).is_ok().then_some(states);
    }
}

/// What the launch of this node knows; nothing when none runs, or it is of another version.
pub(crate) fn read(node: &Node) -> Vec<ChildState> {
    if node.launcher().is_none() {
        return Vec::new();
    }
    let bytes = node.read_file(FILE).ok().flatten().unwrap_or_default();
    let states = bytes.strip_prefix(&form()).and_then(|states| postcard::from_bytes(states).ok());
    states.unwrap_or_default()
}

/// Computed from the types, as is the hash of launch's interface, which has them too.
fn form() -> [u8; 4] {
    LauncherInterface::hash().to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// With a mode for a group, its users can leave what they want in the directory.
    #[test]
    fn a_link_in_the_way_leads_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o770).unwrap();
        let victim = folder.path().join("of root");
        fs::write(&victim, "kept").unwrap();
        symlink(&victim, node.path().join("children.new")).unwrap();
        Known::default().write(&node, Vec::new());
        assert_eq!(fs::read_to_string(&victim).unwrap(), "kept");
        assert_eq!(fs::read(node.path().join(FILE)).unwrap(), [&form()[..], &[0]].concat());
    }

    #[test]
    fn a_pipe_in_the_place_of_the_file_is_waited_for_by_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let _launch = node.launch_lock().unwrap();
        nix::unistd::mkfifo(&node.path().join(FILE), nix::sys::stat::Mode::S_IRWXU).unwrap();
        assert!(read(&node).is_empty());
    }
}
