//! Mailbox names: 32 bits that say which module a package is for, and nothing about where that runs (seed 002, 2.2.2).
//!
//! ```text
//!   31      24 23      16 15       8 7        0
//!  ┌──────────┬──────────┬──────────┬──────────┐
//!  │  system  │  class   │ instance │ local id │     written 1.200.0.2
//!  └──────────┴──────────┴──────────┴──────────┘
//! ```
//!
//! Configuration gives classes their names (`1.motor.0.2`); this crate knows only the numbers.

use std::fmt;
use std::str::FromStr;

/// Importance of a package or a module, 0..=255; 255 is the most urgent. It is the class id, there is no other key for
/// it.
///
/// ```
/// use rohrpost_mailbox::Priority;
///
/// assert!(Priority(200).outranks(Priority(150)));
/// assert_eq!(Priority(200).at_most(Priority(150)), Priority(150));
/// ```
///
/// Deliberately not `Ord`: half the world counts the other way round, so comparisons are spelled out.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Priority(pub u8);

impl Priority {
    /// Whether a package of this priority goes before one of `other`.
    pub const fn outranks(self, other: Self) -> bool {
        self.0 > other.0
    }

    /// The less urgent of two: routers never let a command carry more than its sender's class.
    pub const fn at_most(self, limit: Self) -> Self {
        if self.0 > limit.0 { limit } else { self }
    }
}

/// Kind of module: `laser`, `motor`, … Its number is at once the priority of its modules and their packages.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug, Default)]
pub struct Class(pub u8);

impl Class {
    /// The priority that modules of this class run and send with.
    pub const fn priority(self) -> Priority {
        Priority(self.0)
    }
}

/// Well-known local ids: the mailboxes that every module has.
pub mod local {
    /// Takes commands.
    pub const COMMANDS: u8 = 0;
    /// Takes replies to the module's own commands.
    pub const REPLIES: u8 = 1;
    /// Takes data that the module subscribed to; ids above are the module's own.
    pub const DATA: u8 = 2;
    /// A router's mailbox that takes packages for other nodes; their heads keep the name they are for.
    pub const TRANSIT: u8 = 3;
}

/// System id of a package to all systems.
pub const ALL_SYSTEMS: u8 = 255;

/// A mailbox name. System 0 and class 0 are reserved ("own", "none"); instance 0 is the first of its class.
///
/// ```
/// use rohrpost_mailbox::{Name, local};
///
/// let laser = Name::new(1, 150, 0, local::DATA);
/// assert_eq!(laser.to_string(), "1.150.0.2");
/// assert_eq!(laser.module(), Name::new(1, 150, 0, local::COMMANDS));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Name(u32);

impl Name {
    /// No mailbox: nobody is addressed, or no reply is wanted.
    pub const NONE: Self = Self(0);

    /// Puts a name together from its four parts.
    pub const fn new(system: u8, class: u8, instance: u8, local: u8) -> Self {
        Self(u32::from_be_bytes([system, class, instance, local]))
    }

    /// The name as it stands in a package head.
    pub const fn from_raw(raw: u32) -> Self {
        Self(raw)
    }

    /// The 32 bits.
    pub const fn raw(self) -> u32 {
        self.0
    }

    /// System id, the first byte.
    pub const fn system(self) -> u8 {
        self.0.to_be_bytes()[0]
    }

    /// Class, the second byte.
    pub const fn class(self) -> Class {
        Class(self.0.to_be_bytes()[1])
    }

    /// Instance, the third byte.
    pub const fn instance(self) -> u8 {
        self.0.to_be_bytes()[2]
    }

    /// Local id, the last byte: which of the module's mailboxes.
    pub const fn local(self) -> u8 {
        self.0.to_be_bytes()[3]
    }

    /// Another mailbox of the same module.
    pub const fn with_local(self, local: u8) -> Self {
        Self::new(self.system(), self.class().0, self.instance(), local)
    }

    /// The module's name: local id 0, which is also its command mailbox.
    pub const fn module(self) -> Self {
        self.with_local(local::COMMANDS)
    }

    /// Whether this can be a mailbox's name: system and class are not the reserved zero, and the system is one.
    pub const fn is_mailbox(self) -> bool {
        self.system() != 0 && self.system() != ALL_SYSTEMS && self.class().0 != 0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}.{}", self.system(), self.class().0, self.instance(), self.local())
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Why a text is not a mailbox name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// Not four parts.
    #[error("mailbox name `{0}` has {1} parts; write system.class.instance.local, such as 1.200.0.0")]
    Parts(String, usize),
    /// A part is not a number that fits in a byte.
    #[error("mailbox name `{0}`: `{1}` is not a number from 0 to 255")]
    Part(String, String),
}

impl FromStr for Name {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let parts: Vec<&str> = text.split('.').collect();
        let [system, class, instance, local] = parts[..] else {
            return Err(NameError::Parts(text.into(), parts.len()));
        };
        let byte = |part: &str| part.parse::<u8>().map_err(|_| NameError::Part(text.into(), part.into()));
        Ok(Self::new(byte(system)?, byte(class)?, byte(instance)?, byte(local)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parts_come_back_in_their_places() {
        let name = Name::new(1, 200, 3, 4);
        assert_eq!(name.raw(), 0x01c8_0304);
        assert_eq!((name.system(), name.class(), name.instance(), name.local()), (1, Class(200), 3, 4));
        assert_eq!(name.to_string(), "1.200.3.4");
        assert_eq!(name.module(), Name::new(1, 200, 3, 0));
    }

    #[test]
    fn texts_that_are_no_names_say_why() {
        for (text, why) in [
            ("1.2.3", "mailbox name `1.2.3` has 3 parts; write system.class.instance.local, such as 1.200.0.0"),
            ("1.2.3.256", "mailbox name `1.2.3.256`: `256` is not a number from 0 to 255"),
            ("1..3.4", "mailbox name `1..3.4`: `` is not a number from 0 to 255"),
            ("1.-2.3.4", "mailbox name `1.-2.3.4`: `-2` is not a number from 0 to 255"),
        ] {
            assert_eq!(text.parse::<Name>().unwrap_err().to_string(), why);
        }
    }

    #[test]
    fn reserved_parts_are_no_mailbox() {
        for (name, is) in [
            (Name::new(1, 2, 0, 0), true),
            (Name::new(0, 2, 1, 0), false),
            (Name::new(1, 0, 1, 0), false),
            (Name::new(ALL_SYSTEMS, 2, 1, 0), false),
            (Name::NONE, false),
        ] {
            assert_eq!(name.is_mailbox(), is, "{name}");
        }
    }

    proptest! {
        #[test]
        fn text_and_raw_return_the_same_name(raw: u32) {
            let name = Name::from_raw(raw);
            prop_assert_eq!(name.to_string().parse::<Name>(), Ok(name));
            prop_assert_eq!(Name::new(name.system(), name.class().0, name.instance(), name.local()), name);
        }
    }
}
