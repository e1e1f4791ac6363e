//! Values that were published.

use std::borrow::Cow;

/// The newest value of one kind of data, kept for those that ask for it.
#[derive(Default)]
pub(crate) struct Newest {
    pub(crate) endpoint: usize,
    pub(crate) number: u16,
    /// Its name, for messages.
    pub(crate) name: Cow<'static, str>,
    pub(crate) stamp_ns: u64,
    /// Postcard of the value.
    pub(crate) value: Vec<u8>,
}

impl Newest {
    pub(crate) fn published(&self) -> Published<'_> {
        let Self { endpoint, number, ref name, stamp_ns, ref value } = *self;
        Published { endpoint, number, name, stamp_ns, value }
    }
}

/// A value that was published, wherever it is kept.
pub(crate) struct Published<'a> {
    pub(crate) endpoint: usize,
    pub(crate) number: u16,
    /// Its name, for messages.
    pub(crate) name: &'a str,
    pub(crate) stamp_ns: u64,
    /// Postcard of the value.
    pub(crate) value: &'a [u8],
}
