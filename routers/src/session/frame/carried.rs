//! What a session is for: packages, and the time.

use super::BadSessionFrame;
use super::fields::FieldReader;
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

/// A package under way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Carried<'a> {
    /// How often it was handed on.
    pub hops: u8,
    /// When its sender published it, ns of the server's session clock; 0: its sender does not know.
    pub published_ns: u64,
    /// Its head.
    pub head: Head,
    /// As long as the head says.
    pub body: &'a [u8],
}

impl<'a> Carried<'a> {
    pub(super) fn parse(hops: u8, fields: &mut FieldReader<'a>) -> Result<Self, BadSessionFrame> {
        let published_ns = fields.long()?;
        let head: [u8; PACKAGE_HEAD_BYTES] = fields.array()?;
        let body = fields.rest();
        match Head::from_bytes(&head) {
            Ok(head) if usize::from(head.len) == body.len() => Ok(Self { hops, published_ns, head, body }),
            _ => Err(BadSessionFrame::Damaged("a package of another length than its frame")),
        }
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        into.extend(self.published_ns.to_le_bytes());
        into.extend(self.head.to_bytes());
        into.extend(self.body);
    }
}

/// The server's time, when a question came and when the answer left.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TimeAnswer {
    /// The asker's own time, as it asked, ns.
    pub asked_ns: u64,
    /// The question was read, ns of the server's session clock.
    pub came_ns: u64,
    /// The answer left, ns of the same.
    pub left_ns: u64,
    /// System time then, ns since 1970.
    pub system_ns: u64,
    /// How far off that is at most, ns; [`ERROR_UNKNOWN_NS`]: the server does not know it.
    pub error_ns: u64,
    /// Epoch of that time.
    pub epoch: u64,
}

impl TimeAnswer {
    pub(super) fn parse(fields: &mut FieldReader<'_>) -> Result<Self, BadSessionFrame> {
        let answer = Self {
            asked_ns: fields.long()?,
            came_ns: fields.long()?,
            left_ns: fields.long()?,
            system_ns: fields.long()?,
            error_ns: fields.long()?,
            epoch: fields.long()?,
        };
        let is_sound = answer.came_ns <= answer.left_ns && answer.error_ns <= ERROR_UNKNOWN_NS;
        if is_sound {
            Ok(answer)
        } else {
            Err(BadSessionFrame::Damaged("an answer that left before its question came"))
        }
    }

    pub(super) fn write(&self, into: &mut Vec<u8>) {
        for long in [self.asked_ns, self.came_ns, self.left_ns, self.system_ns, self.error_ns, self.epoch] {
            into.extend(long.to_le_bytes());
        }
    }
}
