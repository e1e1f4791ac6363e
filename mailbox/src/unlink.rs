//! Taking a mailbox's name away: its file goes, and the words beside it go before.

use crate::about;
use crate::name::Name;
use crate::node::{Node, NodeError, RegistryLock};
use crate::segment::path_of;
use crate::step::step;
use std::fs;

/// Takes a mailbox's name away; the caller owns it.
pub(crate) fn remove(node: &Node, name: Name) -> Result<(), NodeError> {
    unlink(node, name, &RegistryLock::take(node.path())?)
}

/// The same for a caller that holds the lock of the registry.
pub(crate) fn unlink(node: &Node, name: Name, _registry: &RegistryLock) -> Result<(), NodeError> {
    about::remove(node, name);
    fs::remove_file(path_of(node.path(), name)).map_err(|error| NodeError::Io(path_of(node.path(), name), error))?;
    step!("unlink: gone");
    node.raise_registry_epoch();
    Ok(())
}
