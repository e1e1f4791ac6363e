//! What modules say of themselves: noted on their own node, and asked for from others.

mod request;

pub use request::DescriptionRequest;

use crate::call::CallError;
use crate::common::DescriptionPart;
use rohrpost_mailbox::{Name, Node, local};
use rohrpost_schema::Description;

/// Longest description that is asked for, bytes.
const BYTES_MAX: usize = 1 << 20;

/// Puts a module's description together of its parts; `ask` is told how many bytes are there, and returns what comes
/// next.
///
/// ```
/// use rohrpost_mailbox::Name;
/// use rohrpost_modules::{call::CallError, common::DescriptionPart, description::assemble, schema::Description};
///
/// fn of_one_part(module: Name, bytes: &[u8]) -> Result<Description, CallError> {
///     let total = bytes.len() as u32;
///     assemble(module, |from| Ok(DescriptionPart { total, bytes: bytes[from as usize..].to_vec() }))
/// }
/// ```
///
/// # Errors
/// Those of `ask`, and [`CallError::BadReply`].
pub fn assemble(
    module: Name,
    mut ask: impl FnMut(u32) -> Result<DescriptionPart, CallError>,
) -> Result<Description, CallError> {
    let mut bytes = Vec::new();
    loop {
        let part = ask(bytes.len() as u32)?;
        // What it says of itself is a claim.
        if part.total as usize > BYTES_MAX {
            let text = format!("its description of {} bytes is longer than {BYTES_MAX}", part.total);
            return Err(CallError::BadReply(module, text));
        }
        bytes.extend_from_slice(&part.bytes);
        if bytes.len() >= part.total as usize || part.bytes.is_empty() {
            return Description::from_bytes(&bytes).map_err(|error| CallError::BadReply(module, error.to_string()));
        }
    }
}

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
