//! A time to look for.

use crate::fusion::Stamp;

/// A time to look for in a stream.
///
/// ```
/// use rohrpost_modules::fusion::Stamp;
/// use rohrpost_modules::runtime::Moment;
///
/// assert_eq!(Moment::from(1_000), Moment::Ns(1_000));
/// assert_eq!(Moment::from(Stamp::new(2, 1_000)), Moment::Stamp(Stamp::new(2, 1_000)));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Moment {
    /// Of an epoch of system time, as records are: [`super::Record::stamp`].
    Stamp(Stamp),
    /// System time of the present epoch, ns since 1970.
    Ns(u64),
}

impl From<Stamp> for Moment {
    fn from(stamp: Stamp) -> Self {
        Self::Stamp(stamp)
    }
}

impl From<rohrpost_mailbox::Stamp> for Moment {
    fn from(stamp: rohrpost_mailbox::Stamp) -> Self {
        Self::Stamp(Stamp::new(stamp.epoch, stamp.ns))
    }
}

impl From<u64> for Moment {
    fn from(ns: u64) -> Self {
        Self::Ns(ns)
    }
}
