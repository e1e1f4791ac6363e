//! The frames of a session: what stands in the stream of bytes between a client and the server. The page
//! `docs/src/wire.md` is exact.
//!
//! ```text
//!  0        4      5      6   8
//! ┌────────┬──────┬──────┬───┬────────────────────────────────────────────────────────────────────┐
//! │ length │ kind │ hops │ 0 │ `length` bytes, as the kind says                                    │
//! └────────┴──────┴──────┴───┴────────────────────────────────────────────────────────────────────┘
//!  client: hello, then register, then package and ask       server: welcome or refusal, registered, package, answer
//!  both, for replicas: record part, description
//! ```
//!
//! All fields of ours are little-endian; the head of a package is in the order that its own options tell. Each frame is
//! checked once, as a whole; then no accessor can fail.

mod bad;
mod carried;
mod fields;
mod handshake;
mod ranges;

pub use bad::{BadSessionFrame, VERSION};
pub use carried::{Carried, TimeAnswer};
pub use handshake::{NAME_BYTES_MAX, SessionHello, SessionRefusal, SessionRefusalReason, Welcome};
pub use ranges::{Objection, RANGES_MAX, Range, Ranges, RegistrationVerdict};

use crate::frame::{DescriptionPart, RecordPart};
use fields::FieldReader;
use rohrpost_mailbox::{BODY_BYTES_MAX, HEAD_BYTES as PACKAGE_HEAD_BYTES};

/// Bytes before what depends on the kind.
pub const HEAD_BYTES: usize = 8;
/// Bytes behind a frame's head, at most: the largest package, and when it was published.
pub const LENGTH_MAX: usize = PUBLISHED_BYTES + PACKAGE_HEAD_BYTES + BODY_BYTES_MAX;
/// Longest frame before the hello.
pub const HELLO_LENGTH_MAX: usize = 256;
/// A package passes so many servers and programs that hand it on, at most.
pub const HOPS_MAX: u8 = 8;

pub(super) const PUBLISHED_BYTES: usize = 8;

/// What a frame is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum SessionFrameKind {
    /// Client: its identity. The first frame of each connection.
    Hello = 1,
    /// Server: it may take part.
    Welcome = 2,
    /// Server: it may not, or not any more. The last frame.
    Refusal = 3,
    /// Client: the names that it hosts, all of them.
    Register = 4,
    /// Server: whether it does.
    Registered = 5,
    /// A package.
    Package = 6,
    /// Client: what time is it?
    Ask = 7,
    /// Server: the time.
    Answer = 8,
    /// A part of a record of a replica.
    RecordPart = 9,
    /// A part of the description of the module that writes the stream of a replica.
    Description = 10,
}

impl SessionFrameKind {
    const ALL: [Self; 10] = [
        Self::Hello,
        Self::Welcome,
        Self::Refusal,
        Self::Register,
        Self::Registered,
        Self::Package,
        Self::Ask,
        Self::Answer,
        Self::RecordPart,
        Self::Description,
    ];
}

/// What each frame begins with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SessionFrameHead {
    /// What it is.
    pub kind: SessionFrameKind,
    /// How often the package was handed on before.
    pub hops: u8,
    /// Bytes that follow.
    pub length: usize,
}

impl SessionFrameHead {
    /// Reads a head.
    ///
    /// # Errors
    /// [`BadSessionFrame`]; also if more would follow than `length_max`.
    pub fn parse(bytes: &[u8; HEAD_BYTES], length_max: usize) -> Result<Self, BadSessionFrame> {
        if is_tls(bytes) {
            return Err(BadSessionFrame::Tls);
        }
        let mut fields = FieldReader::new(bytes);
        let (length, kind, hops, rest) = (fields.word()?, fields.byte()?, fields.byte()?, fields.rest());
        // First the kind: what is no session mostly begins with text, which makes an odd length.
        let kind = SessionFrameKind::ALL
            .into_iter()
            .find(|known| *known as u8 == kind)
            .ok_or(BadSessionFrame::Damaged("unknown kind"))?;
        if rest != [0; 2] || (hops != 0 && kind != SessionFrameKind::Package) {
            return Err(BadSessionFrame::Damaged("a head with bits that mean nothing"));
        }
        match usize::try_from(length) {
            Ok(length) if length <= length_max => Ok(Self { kind, hops, length }),
            _ => Err(BadSessionFrame::TooLong(length)),
        }
    }
}

/// Whether bytes begin as a record of TLS does: its type, and a version. As a head they would be of a frame that is too
/// long.
pub(super) const fn is_tls(bytes: &[u8]) -> bool {
    matches!(bytes, [20..=23, 3, 1..=4, ..])
}

const _: () = assert!(LENGTH_MAX < 0x01_03_14, "no head begins as a record of TLS");

/// Writes the head of a frame that has so many bytes behind it.
pub(super) fn write_head(kind: SessionFrameKind, length: usize, head: &mut [u8]) {
    head[..4].copy_from_slice(&(length as u32).to_le_bytes());
    head[4..HEAD_BYTES].copy_from_slice(&[kind as u8, 0, 0, 0]);
}

/// A parsed frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SessionMessage<'a> {
    /// Identity of a client.
    Hello(SessionHello<'a>),
    /// It may take part.
    Welcome(Welcome),
    /// It may not.
    Refusal(SessionRefusal<'a>),
    /// The names that it hosts.
    Register(Ranges<'a>),
    /// Whether it does.
    Registered(RegistrationVerdict<'a>),
    /// A package.
    Package(Carried<'a>),
    /// A question for the time, with the asker's own, ns.
    Ask(u64),
    /// The answer.
    Answer(TimeAnswer),
    /// A part of a record.
    Record(RecordPart<'a>),
    /// A part of a description.
    Description(DescriptionPart<'a>),
}

impl<'a> SessionMessage<'a> {
    /// Checks all that a frame says.
    ///
    /// # Errors
    /// [`BadSessionFrame`]
    pub fn parse(head: SessionFrameHead, rest: &'a [u8]) -> Result<Self, BadSessionFrame> {
        let mut fields = FieldReader::new(rest);
        let message = match head.kind {
            SessionFrameKind::Hello => Self::Hello(SessionHello::parse(&mut fields)?),
            SessionFrameKind::Welcome => Self::Welcome(Welcome::parse(&mut fields)?),
            SessionFrameKind::Refusal => Self::Refusal(SessionRefusal::parse(&mut fields)?),
            SessionFrameKind::Register => Self::Register(Ranges::parse(&mut fields)?),
            SessionFrameKind::Registered => Self::Registered(RegistrationVerdict::parse(&mut fields)?),
            SessionFrameKind::Package => Self::Package(Carried::parse(head.hops, &mut fields)?),
            SessionFrameKind::Ask => Self::Ask(fields.long()?),
            SessionFrameKind::Answer => Self::Answer(TimeAnswer::parse(&mut fields)?),
            SessionFrameKind::RecordPart => Self::Record(RecordPart::parse(fields.rest())?),
            SessionFrameKind::Description => Self::Description(DescriptionPart::parse(fields.rest())?),
        };
        if !fields.rest().is_empty() {
            return Err(BadSessionFrame::Damaged("a frame with bytes behind its end"));
        }
        Ok(message)
    }

    /// The frame alone.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.write(&mut bytes);
        bytes
    }

    /// Appends the frame.
    pub fn write(&self, into: &mut Vec<u8>) {
        match self {
            Self::Hello(hello) => frame(into, SessionFrameKind::Hello, 0, |into| hello.write(into)),
            Self::Welcome(welcome) => frame(into, SessionFrameKind::Welcome, 0, |into| welcome.write(into)),
            Self::Refusal(refusal) => frame(into, SessionFrameKind::Refusal, 0, |into| refusal.write(into)),
            Self::Register(ranges) => frame(into, SessionFrameKind::Register, 0, |into| ranges.write(into)),
            Self::Registered(verdict) => frame(into, SessionFrameKind::Registered, 0, |into| verdict.write(into)),
            Self::Package(carried) => frame(into, SessionFrameKind::Package, carried.hops, |into| carried.write(into)),
            Self::Ask(asked_ns) => frame(into, SessionFrameKind::Ask, 0, |into| into.extend(asked_ns.to_le_bytes())),
            Self::Answer(answer) => frame(into, SessionFrameKind::Answer, 0, |into| answer.write(into)),
            Self::Record(part) => part_frame(into, SessionFrameKind::RecordPart, &part.head_bytes(), part.bytes),
            Self::Description(part) => part_frame(into, SessionFrameKind::Description, &part.head_bytes(), part.bytes),
        }
    }
}

fn part_frame(into: &mut Vec<u8>, kind: SessionFrameKind, head: &[u8], bytes: &[u8]) {
    frame(into, kind, 0, |into| {
        into.extend(head);
        into.extend(bytes);
    });
}

fn frame(into: &mut Vec<u8>, kind: SessionFrameKind, hops: u8, rest: impl FnOnce(&mut Vec<u8>)) {
    let start = into.len();
    into.extend([0, 0, 0, 0, kind as u8, hops, 0, 0]);
    rest(into);
    let length = (into.len() - start - HEAD_BYTES) as u32;
    into[start..start + 4].copy_from_slice(&length.to_le_bytes());
}

#[cfg(test)]
mod tests;
