//! How data came, and what tells to which subscription they belong.

use rohrpost_mailbox::Stamp;
use rohrpost_schema::Data;

/// How data came. Not for people: its module is private.
#[derive(Clone, Copy)]
pub enum Origin {
    /// In a package, by the subscription of this id if it is one's own mailbox.
    Package { mailbox: u8, id: u16 },
    /// In a stream's record, by the subscription of this id. Whether each record of the stream is recorded.
    Stream { id: u16, stamp: Stamp, is_recorded: bool },
}

/// A subscription, to data or to a stream.
///
/// ```
/// use rohrpost_modules::runtime::{Received, Subscribed, Unreadable};
///
/// fn stamped<S: Subscribed>(data: &Received<'_>, by: &S) -> Result<Option<(u64, S::Item)>, Unreadable> {
///     Ok(data.read(by)?.map(|value| (data.head.stamp_ns, value)))
/// }
/// ```
pub trait Subscribed: seal::Kind {
    /// What it brings.
    type Item: Data;
}

/// Nobody outside adds a kind of subscription.
pub(super) mod seal {
    use super::Origin;

    /// How a subscription knows its data.
    pub trait Kind {
        /// Whether data came by it.
        fn brought(&self, origin: Origin) -> bool;
    }
}
