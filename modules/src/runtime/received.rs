//! Data on their way to a module.

use super::follow::Subscription;
use crate::common::DataHead;
use rohrpost_mailbox::Name;
use rohrpost_schema::Data;

/// Data that a subscription brought.
pub struct Received<'a> {
    /// The module that published it.
    pub from: Name,
    /// Data number in its interface.
    pub number: u16,
    /// Mailbox it came to.
    pub mailbox: u8,
    /// Which subscription.
    pub(crate) id: u16,
    /// Time, number, misses.
    pub head: DataHead,
    /// The value, postcard.
    pub value: &'a [u8],
}

impl Received<'_> {
    /// The value, if it belongs to this subscription and can be read. What cannot be read is told as a warning.
    pub fn read<T: Data>(&self, subscription: &Subscription<T>) -> Option<T> {
        if self.is_of(subscription) { self.decode() } else { None }
    }

    /// The value, if it came to this mailbox, which takes data from all ([`super::Context::open_mailbox_to_all`]), and can be read.
    pub fn read_from<T: Data>(&self, mailbox: u8) -> Option<T> {
        if self.mailbox == mailbox { self.decode() } else { None }
    }

    fn decode<T: Data>(&self) -> Option<T> {
        match postcard::from_bytes(self.value) {
            Ok(value) => Some(value),
            Err(error) => {
                tracing::warn!("data {} of {} cannot be read: {error}", self.number, self.from);
                None
            }
        }
    }

    /// Whether it belongs to this subscription.
    pub fn is_of<T>(&self, subscription: &Subscription<T>) -> bool {
        (self.mailbox, self.id) == (subscription.mailbox, subscription.id)
    }
}
