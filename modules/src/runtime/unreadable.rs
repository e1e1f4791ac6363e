//! Why data cannot be read.

use rohrpost_mailbox::Name;

/// Data that came are not of the type that their publisher's interface says.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("data {number} of {from} cannot be read: {error}; its publisher does not write what its interface says")]
pub struct Unreadable {
    from: Name,
    number: u16,
    error: postcard::Error,
}

impl Unreadable {
    pub(super) fn new(from: Name, number: u16, error: postcard::Error) -> Self {
        Self { from, number, error }
    }
}
