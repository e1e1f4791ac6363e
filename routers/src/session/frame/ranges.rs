//! Registration: the names that a client hosts, and what the server says to it.

use super::fields::FieldReader;
use super::{BadSessionFrame, NAME_BYTES_MAX};
use rohrpost_mailbox::Name;

/// Ranges of one client, at most: a system of 64 nodes with 30 modules each, all behind one.
pub const RANGES_MAX: usize = 2048;

/// Mailbox names that lie one behind the other.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Range {
    /// The first.
    pub first: Name,
    /// The last.
    pub last: Name,
}

impl Range {
    /// All mailboxes of a module.
    pub const fn module(name: Name) -> Self {
        Self { first: name.with_local(0), last: name.with_local(u8::MAX) }
    }

    /// Whether a name lies in it.
    pub fn has(&self, name: Name) -> bool {
        (self.first..=self.last).contains(&name)
    }

    /// Whether all of another lies in it.
    pub fn holds(&self, other: &Self) -> bool {
        self.first <= other.first && other.last <= self.last
    }

    /// Whether it has a name in common with another.
    pub fn meets(&self, other: &Self) -> bool {
        self.first <= other.last && other.first <= self.last
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} to {}", self.first, self.last)
    }
}

/// The names that a client hosts; an iterator over them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ranges<'a> {
    /// Comes back with the verdict.
    pub number: u32,
    bytes: &'a [u8],
}

const RANGE_BYTES: usize = 8;

impl<'a> Ranges<'a> {
    /// Lays ranges out in `bytes`.
    pub fn new(number: u32, ranges: &[Range], bytes: &'a mut Vec<u8>) -> Self {
        bytes.clear();
        for range in ranges {
            bytes.extend(range.first.raw().to_le_bytes());
            bytes.extend(range.last.raw().to_le_bytes());
        }
        Self { number, bytes }
    }

    pub(super) fn parse(fields: &mut FieldReader<'a>) -> Result<Self, BadSessionFrame> {
        let ranges = Self { number: fields.word()?, bytes: fields.rest() };
        let is_whole = ranges.bytes.len().is_multiple_of(RANGE_BYTES);
        let is_short = ranges.bytes.len() <= RANGES_MAX * RANGE_BYTES;
        if is_whole && is_short {
            Ok(ranges)
        } else {
            Err(BadSessionFrame::Damaged("ranges that are cut, or too many"))
        }
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(self.number.to_le_bytes());
        into.extend(self.bytes);
    }
}

impl Iterator for Ranges<'_> {
    type Item = Range;

    fn next(&mut self) -> Option<Range> {
        let (range, rest) = self.bytes.split_first_chunk::<RANGE_BYTES>()?;
        self.bytes = rest;
        let name =
            |at: usize| Name::from_raw(u32::from_le_bytes([range[at], range[at + 1], range[at + 2], range[at + 3]]));
        Some(Range { first: name(0), last: name(4) })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let count = self.bytes.len() / RANGE_BYTES;
        (count, Some(count))
    }
}

impl ExactSizeIterator for Ranges<'_> {}

/// Why a client does not host what it says.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum Objection {
    /// Another client hosts the same, or what it lies in.
    Taken = 1,
    /// It has names in common with what another client hosts, and does not lie in it; or crosses another range of its
    /// own.
    Crosses = 2,
    /// Not of the client's system, or the first behind the last, or given to another node by the server's file.
    NotOwn = 3,
    /// The server has no room for more ranges, or not of this principal.
    TooMany = 4,
}

/// The server's verdict on a registration: all of it is in force, or nothing of it changes anything.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RegistrationVerdict<'a> {
    /// As the registration had it.
    pub number: u32,
    /// What speaks against it; none: it holds.
    pub objection: Option<Objection>,
    /// The range that it is about.
    pub range: Range,
    /// The host of the range in conflict.
    pub holder: &'a str,
}

impl<'a> RegistrationVerdict<'a> {
    pub(super) fn parse(fields: &mut FieldReader<'a>) -> Result<Self, BadSessionFrame> {
        let (number, objection) = (fields.word()?, fields.byte()?);
        fields.zeroes::<3>()?;
        let known = [Objection::Taken, Objection::Crosses, Objection::NotOwn, Objection::TooMany];
        let found = known.into_iter().find(|known| *known as u8 == objection);
        if found.is_none() && objection != 0 {
            return Err(BadSessionFrame::Damaged("unknown objection"));
        }
        let range = Range { first: Name::from_raw(fields.word()?), last: Name::from_raw(fields.word()?) };
        Ok(Self { number, objection: found, range, holder: fields.text(NAME_BYTES_MAX)? })
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(self.number.to_le_bytes());
        into.extend([self.objection.map_or(0, |objection| objection as u8), 0, 0, 0]);
        into.extend(self.range.first.raw().to_le_bytes());
        into.extend(self.range.last.raw().to_le_bytes());
        into.extend(self.holder.as_bytes());
    }
}

impl std::fmt::Display for RegistrationVerdict<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { range, holder, .. } = self;
        match self.objection {
            None => write!(f, "registered"),
            Some(Objection::Taken) => {
                write!(f, "{range} is hosted by {holder}; end it, or give one of both another name")
            }
            Some(Objection::Crosses) => {
                write!(f, "{range} has names in common with what {holder} hosts; register none of those, or end it")
            }
            Some(Objection::NotOwn) => write!(
                f,
                "{range} is no range of names of this client's system, or of its node, if the file of the TCP router \
                has that; \
                 start it from that file, or take other names"
            ),
            Some(Objection::TooMany) => {
                write!(f, "the TCP router has no room for more ranges from here; register wider ones")
            }
        }
    }
}
