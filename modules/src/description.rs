//! What modules say of themselves: noted on their own node, and asked for from others.

mod request;

pub use request::DescriptionRequest;

use rohrpost_mailbox::{Name, Node, local};
use rohrpost_schema::Description;

/// What the module under this name has noted of itself beside its command mailbox; asks nobody. None when it noted
/// nothing that can be read.
///
/// ```
/// # use rohrpost_mailbox::{Name, Node};
/// fn class(node: &Node, module: Name) -> Option<String> {
///     Some(rohrpost_modules::description::noted(node, module)?.class)
/// }
/// ```
pub fn noted(node: &Node, module: Name) -> Option<Description> {
    Description::from_bytes(&node.about(module.with_local(local::COMMANDS))?).ok()
}
