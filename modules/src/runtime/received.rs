//! Data on their way to a module.

use super::follow::Subscription;
use crate::common::DataHead;
use rohrpost_mailbox::Name;
use rohrpost_schema::Data;

/// Data that came are not of the type that their publisher's interface says.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("data {number} of {from} cannot be read: {error}; its publisher does not write what its interface says")]
pub struct Unreadable {
    from: Name,
    number: u16,
    error: postcard::Error,
}

/// Data that a subscription brought.
///
/// ```
/// use rohrpost_modules::runtime::{Received, Subscription, Unreadable};
/// use rohrpost_modules::types::Odometry;
///
/// fn speed_m_s(data: &Received<'_>, odometry: &Subscription<Odometry>) -> Result<Option<f64>, Unreadable> {
///     Ok(data.read(odometry)?.map(|odometry| odometry.twist.speed_m_s))
/// }
/// ```
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
    /// The value, if it belongs to this subscription; none of what belongs to another.
    ///
    /// # Errors
    /// It belongs to it, and cannot be read.
    pub fn read<T: Data>(&self, subscription: &Subscription<T>) -> Result<Option<T>, Unreadable> {
        self.is_of(subscription).then(|| self.decode()).transpose()
    }

    /// The value, if it came to this mailbox, which takes data from all ([`super::Context::open_mailbox_to_all`]).
    ///
    /// ```
    /// # use rohrpost_modules::{runtime::{Received, Unreadable}, types::Pose};
    /// const POSES: u8 = 3;
    ///
    /// fn pose(data: &Received<'_>) -> Result<Option<Pose>, Unreadable> {
    ///     data.read_from(POSES)
    /// }
    /// ```
    ///
    /// # Errors
    /// It came there, and cannot be read.
    pub fn read_from<T: Data>(&self, mailbox: u8) -> Result<Option<T>, Unreadable> {
        (self.mailbox == mailbox).then(|| self.decode()).transpose()
    }

    fn decode<T: Data>(&self) -> Result<T, Unreadable> {
        postcard::from_bytes(self.value).map_err(|error| Unreadable { from: self.from, number: self.number, error })
    }

    /// Whether it belongs to this subscription.
    ///
    /// ```
    /// # use rohrpost_modules::{runtime::{Received, Subscription}, types::Odometry};
    /// fn missed(data: &Received<'_>, odometry: &Subscription<Odometry>) -> u32 {
    ///     if data.is_of(odometry) { data.head.missed.into() } else { 0 }
    /// }
    /// ```
    pub fn is_of<T>(&self, subscription: &Subscription<T>) -> bool {
        (self.mailbox, self.id) == (subscription.mailbox, subscription.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: DataHead = DataHead { stamp_ns: 0, sequence: 0, missed: 0, incarnation: 0 };

    #[test]
    fn what_is_of_another_is_told_from_what_cannot_be_read() {
        let from = Name::new(1, 150, 0, 0);
        let read = |id: u16, mailbox: u8, value: &[u8]| {
            let received = Received { from, number: 3, mailbox, id, head: HEAD, value };
            received.read(&Subscription::<u16>::new(7, 2))
        };
        assert_eq!(read(7, 2, &[5]), Ok(Some(5)));
        assert_eq!(read(8, 2, &[0xff]), Ok(None));
        assert_eq!(read(7, 3, &[0xff]), Ok(None));
        let told = read(7, 2, &[0xff]).unwrap_err().to_string();
        assert!(told.starts_with("data 3 of 1.150.0.0 cannot be read: "), "{told}");
    }
}
