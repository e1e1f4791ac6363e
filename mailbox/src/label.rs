//! What a sender says of a package.

use crate::figures::traffic::Key;
use crate::name::{Name, Priority};
use crate::package::{Head, Options, Type};

/// What a sender says of a package besides its body; the mailbox's name and the length are filled in.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Label {
    /// Mailbox that answers go to.
    pub from: Name,
    /// What it is.
    pub kind: Type,
    /// Tells packages of one type apart.
    pub id: u16,
    /// How urgent.
    pub priority: Priority,
    /// Option bits.
    pub options: Options,
}

impl Label {
    #[inline]
    pub(crate) fn head(&self, to: Name, len: usize) -> Head {
        let Self { from, kind, id, priority, options } = *self;
        Head { to, from, len: len as u16, kind, id, priority, options }
    }

    /// Where such packages are counted.
    #[inline]
    pub(crate) fn key(&self, to: Name) -> Key {
        Key { to, from: self.from, kind: self.kind }
    }
}
