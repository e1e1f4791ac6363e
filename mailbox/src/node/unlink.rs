//! Taking a mailbox's name away: its file goes, and the words beside it go before.

use crate::memory::segment::file_name;
use crate::name::Name;
use crate::node::about;
use crate::node::directory::{Node, RegistryLock};
use crate::node::error::NodeError;
use crate::step::step;

/// Takes a mailbox's name away; the caller owns it.
pub(crate) fn remove(node: &Node, name: Name) -> Result<(), NodeError> {
    unlink(node, name, &RegistryLock::take(node.directory())?)
}

/// The same for a caller that holds the lock of the registry.
pub(crate) fn unlink(node: &Node, name: Name, _registry: &RegistryLock) -> Result<(), NodeError> {
    about::remove(node, name);
    let file = file_name(name);
    node.directory().remove(&file).map_err(|error| NodeError::Io(node.path().join(file), error))?;
    step!("unlink: gone");
    node.raise_registry_epoch();
    Ok(())
}
