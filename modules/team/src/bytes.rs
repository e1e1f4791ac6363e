//! Reads and writes little-endian fields of messages.

use crate::ids::{Position, RobotId, Version};

/// Why bytes are no message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Malformed {
    /// Shorter or longer than its counts say.
    #[error("message ends or goes on at byte {at}, which its counts do not say")]
    Length {
        /// Where reading stopped.
        at: usize,
    },
    /// A field has a value that is none.
    #[error("byte {at}: {what}")]
    Value {
        /// Behind the field.
        at: usize,
        /// What would be right.
        what: &'static str,
    },
}

pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let field = self.bytes.get(self.at..).and_then(<[u8]>::first_chunk).ok_or(Malformed::Length { at: self.at })?;
        self.at += N;
        Ok(*field)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Malformed> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Malformed> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Malformed> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(crate) fn i16(&mut self) -> Result<i16, Malformed> {
        Ok(i16::from_le_bytes(self.array()?))
    }

    pub(crate) fn robot(&mut self) -> Result<RobotId, Malformed> {
        let system = self.u8()?;
        RobotId::new(system).ok_or_else(|| self.wrong("a robot's number is 1 to 254"))
    }

    pub(crate) fn version(&mut self) -> Result<Version, Malformed> {
        Ok(Version { incarnation: self.u32()?, counter: self.u32()? })
    }

    pub(crate) fn position(&mut self) -> Result<Position, Malformed> {
        let (x, y) = (self.array()?, self.array()?);
        Ok(Position { x_mm: i32::from_le_bytes(x), y_mm: i32::from_le_bytes(y) })
    }

    /// What is wrong with the field before.
    pub(crate) fn wrong(&self, what: &'static str) -> Malformed {
        Malformed::Value { at: self.at, what }
    }

    /// That what was read has this property.
    pub(crate) fn check(&self, holds: bool, what: &'static str) -> Result<(), Malformed> {
        if holds { Ok(()) } else { Err(self.wrong(what)) }
    }

    /// That nothing follows.
    pub(crate) fn end(&self) -> Result<(), Malformed> {
        if self.at == self.bytes.len() { Ok(()) } else { Err(Malformed::Length { at: self.at }) }
    }
}

pub(crate) fn put_version(bytes: &mut Vec<u8>, version: Version) {
    bytes.extend(version.incarnation.to_le_bytes());
    bytes.extend(version.counter.to_le_bytes());
}

pub(crate) fn put_position(bytes: &mut Vec<u8>, position: Position) {
    bytes.extend(position.x_mm.to_le_bytes());
    bytes.extend(position.y_mm.to_le_bytes());
}
