//! A package: a head of 16 bytes and a body. The only thing modules exchange (seed 002, 3.1).
//!
//! ```text
//!  0      4      8     10     12    14        15       16
//!  ┌──────┬──────┬─────┬──────┬─────┬─────────┬────────┬────────────┐
//!  │  to  │ from │ len │ type │ id  │ priority│ options│ body (len) │
//!  └──────┴──────┴─────┴──────┴─────┴─────────┴────────┴────────────┘
//! ```
//!
//! Bit 0 of the options tells the byte order of the head's other fields, and stands where it can be read before them.

use crate::name::{Name, Priority};

/// Bytes of a head.
pub const HEAD_BYTES: usize = 16;

/// Largest body. What is larger is a stream, not a package.
pub const BODY_BYTES_MAX: usize = u16::MAX as usize - HEAD_BYTES;

/// What a package is: `> 0` a command, `-1..=-16383` the reply to command `-n`, from -16384 downwards data.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug, Default)]
pub struct Type(pub i16);

/// What a [`Type`] means.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Kind {
    /// Command number: asks the receiver to do something.
    Command(u16),
    /// Reply to the command of this number.
    Reply(u16),
    /// Data of this number, sent because somebody subscribed, or an event.
    Data(u16),
    /// Zero, which nothing carries.
    None,
}

impl Type {
    /// Largest number of a command (and so of its reply).
    pub const COMMAND_MAX: u16 = 16383;
    /// Largest number of a kind of data.
    pub const DATA_MAX: u16 = 16384;

    /// The type of a command.
    ///
    /// # Panics
    /// When `number` is 0 or above [`Type::COMMAND_MAX`]; numbers are constants of interfaces.
    pub const fn command(number: u16) -> Self {
        assert!(number > 0 && number <= Self::COMMAND_MAX);
        Self(number as i16)
    }

    /// The type of the reply to command `number`.
    pub const fn reply(number: u16) -> Self {
        Self(-Self::command(number).0)
    }

    /// The type of data `number`.
    ///
    /// # Panics
    /// When `number` is above [`Type::DATA_MAX`].
    pub const fn data(number: u16) -> Self {
        assert!(number <= Self::DATA_MAX);
        Self((-16384 - number as i32) as i16)
    }

    /// What it is.
    pub const fn kind(self) -> Kind {
        match self.0 {
            0 => Kind::None,
            n @ 1..=16383 => Kind::Command(n as u16),
            // 16384 and above would have no reply; nothing sends them.
            16384..=i16::MAX => Kind::None,
            n @ -16383..=-1 => Kind::Reply(n.unsigned_abs()),
            n => Kind::Data((-(n as i32) - 16384) as u16),
        }
    }
}

/// Option bits of a head.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Options(pub u8);

impl Options {
    /// The head's fields are big-endian.
    pub const BIG_ENDIAN: Self = Self(1);
    /// The body's first 8 bytes are the system time of its making, nanoseconds since 1970, little-endian; counted in
    /// `len`.
    pub const STAMPED: Self = Self(2);
    /// The body is a fault, not the answer that was asked for.
    pub const ERROR: Self = Self(4);
    /// Its receiver died while it had this package; it is handed out a second and last time.
    pub const REDELIVERED: Self = Self(8);
    /// Of data: of one sender, receiver, type and id only the newest counts, so a newer package may replace this one on
    /// its way. Of the command that subscribes: the data are to be such.
    pub const NEWEST: Self = Self(16);

    /// Whether all bits of `other` are set.
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Both.
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These without those of `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

/// A package's head.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Head {
    /// Mailbox it goes to.
    pub to: Name,
    /// Mailbox that answers go to; also names the sender.
    pub from: Name,
    /// Bytes of the body.
    pub len: u16,
    /// What it is.
    pub kind: Type,
    /// Tells packages of one type apart; a reply carries its command's.
    pub id: u16,
    /// How urgent.
    pub priority: Priority,
    /// Option bits.
    pub options: Options,
}

/// Fewer than [`HEAD_BYTES`], or a body cut short.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("package of {have} bytes is shorter than the {need} it needs")]
pub struct Short {
    /// Bytes there are.
    pub have: usize,
    /// Bytes there should be at least.
    pub need: usize,
}

impl Head {
    /// The head in this machine's byte order, with the order bit set to match.
    pub fn to_bytes(&self) -> [u8; HEAD_BYTES] {
        let order = if cfg!(target_endian = "big") { Options::BIG_ENDIAN } else { Options(0) };
        let mut bytes = [0; HEAD_BYTES];
        bytes[0..4].copy_from_slice(&self.to.raw().to_ne_bytes());
        bytes[4..8].copy_from_slice(&self.from.raw().to_ne_bytes());
        bytes[8..10].copy_from_slice(&self.len.to_ne_bytes());
        bytes[10..12].copy_from_slice(&self.kind.0.to_ne_bytes());
        bytes[12..14].copy_from_slice(&self.id.to_ne_bytes());
        bytes[14] = self.priority.0;
        bytes[15] = self.options.without(Options::BIG_ENDIAN).with(order).0;
        bytes
    }

    /// Reads a head of either byte order. The order bit of the result is clear: the fields are this machine's now.
    ///
    /// # Errors
    /// [`Short`] when there are fewer than 16 bytes. Any 16 bytes are a head; whether its length fits is the caller's
    /// to check.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Short> {
        bytes.first_chunk().map(Self::of).ok_or(Short { have: bytes.len(), need: HEAD_BYTES })
    }

    /// The same of as many bytes as a head has.
    #[inline]
    pub(crate) fn of(bytes: &[u8; HEAD_BYTES]) -> Self {
        if Options(bytes[15]).has(Options::BIG_ENDIAN) {
            Self::parse(bytes, u32::from_be_bytes, u16::from_be_bytes)
        } else {
            Self::parse(bytes, u32::from_le_bytes, u16::from_le_bytes)
        }
    }

    #[inline]
    fn parse(b: &[u8; HEAD_BYTES], word: impl Fn([u8; 4]) -> u32, half: impl Fn([u8; 2]) -> u16) -> Self {
        Self {
            to: Name::from_raw(word([b[0], b[1], b[2], b[3]])),
            from: Name::from_raw(word([b[4], b[5], b[6], b[7]])),
            len: half([b[8], b[9]]),
            kind: Type(half([b[10], b[11]]).cast_signed()),
            id: half([b[12], b[13]]),
            priority: Priority(b[14]),
            options: Options(b[15]).without(Options::BIG_ENDIAN),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn kinds_split_the_number_range_without_gap_or_overlap() {
        let (mut commands, mut replies, mut data, mut none) = (0, 0, 0, 0);
        for n in i16::MIN..=i16::MAX {
            match Type(n).kind() {
                Kind::Command(c) => (assert_eq!(Type::command(c).0, n), commands += 1).1,
                Kind::Reply(c) => (assert_eq!(Type::reply(c).0, n), replies += 1).1,
                Kind::Data(d) => (assert_eq!(Type::data(d).0, n), data += 1).1,
                Kind::None => none += 1,
            }
        }
        assert_eq!((commands, replies, data, none), (16383, 16383, 16385, 1 + 16384));
    }

    #[test]
    fn a_head_has_the_documented_bytes() {
        let head = Head {
            to: Name::new(1, 200, 0, 0),
            from: Name::new(1, 16, 2, 1),
            len: 0x0102,
            kind: Type::reply(16),
            id: 0x0304,
            priority: Priority(200),
            options: Options::STAMPED,
        };
        let little = [0, 0, 200, 1, 1, 2, 16, 1, 2, 1, 0xf0, 0xff, 4, 3, 200, 2];
        let big = [1, 200, 0, 0, 1, 16, 2, 1, 1, 2, 0xff, 0xf0, 3, 4, 200, 3];
        assert_eq!(head.to_bytes(), if cfg!(target_endian = "big") { big } else { little });
        assert_eq!(Head::from_bytes(&little), Ok(head));
        assert_eq!(Head::from_bytes(&big), Ok(head));
        assert_eq!(Head::from_bytes(&little[..15]), Err(Short { have: 15, need: 16 }));
    }

    proptest! {
        #[test]
        fn any_sixteen_bytes_are_a_head_and_come_back(bytes: [u8; 16]) {
            let head = Head::from_bytes(&bytes).unwrap();
            prop_assert_eq!(Head::from_bytes(&head.to_bytes()), Ok(head));
        }
    }
}
