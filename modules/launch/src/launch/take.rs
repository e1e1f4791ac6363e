//! A node's directory, and the right to launch it.

use rohrpost_mailbox::{LaunchLock, Node, NodeError};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// A node that somebody else removes just now is taken at the next try, or the next but one.
const TAKE_MAX: usize = 20;

/// Makes a node and becomes its launch.
pub(super) fn take_node(path: &Path, mode: u32) -> Result<(Arc<Node>, LaunchLock), NodeError> {
    let mut tries = 0;
    loop {
        match Node::create(path, mode).and_then(|node| Ok((node.launch_lock()?, node))) {
            Ok((lock, node)) => return Ok((node, lock)),
            Err(error) if tries == TAKE_MAX || !passes(&error) => return Err(error),
            Err(_) => {}
        }
        tries += 1;
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Whether an earlier launch that ends just now, or `rohrpost clean`, may be the reason: they keep all others out while
/// they remove a node, which takes a moment.
fn passes(error: &NodeError) -> bool {
    match error {
        NodeError::Missing(_) | NodeError::Launched(..) => true,
        NodeError::Io(_, error) => error.kind() == ErrorKind::NotFound,
        _ => false,
    }
}
