//! Bytes of a datagram between routers: checked once, then no accessor can fail. The page `docs/src/wire.md` is exact.
//!
//! ```text
//!  0     2    3    4       5     6     7  8        16            24         32      36
//! ┌──────┬────┬────┬───────┬─────┬────┬──┬────────┬─────────────┬──────────┬───────┬─────────────────────────────┐
//! │ "Rp" │ v1 │kind│system │from │ to │ 0│ digest │ incarnation │ sequence │ check │ content by kind             │
//! └──────┴────┴────┴───────┴─────┴────┴──┴────────┴─────────────┴──────────┴───────┴─────────────────────────────┘
//!  packages: (head 16, body) repeated     fragment: first u64, index u16, count u16, offset u32, package head, bytes
//!  alive: incarnation u64 and next sequence u64 of the peer as heard here, datagrams of it that were missed u64
//!  refusal: reason u8, 7 × 0, own digest u64              16 and above: time, see `time`
//!  record part, description: see `replica`; part request: see `part_request`
//!  byte 7: key of the seal over the content, 0: none, see `security`; hello: always sealed
//! ```
//!
//! Little-endian; a package head has the order of its options. The check is the CRC-32 of zlib over all other bytes.

mod fields;
mod part_request;
mod refusal;
mod replica;

use crate::port::{Port, SEQUENCES};
pub(crate) use fields::long;
pub use fields::{BadFrame, VERSION};
pub use part_request::{ASKED_PARTS_MAX, PART_REQUEST_BYTES_MAX, PartRequest, PartRequestBytes};
pub use refusal::{Refusal, RefusalReason};
pub use replica::{DESCRIPTION_BYTES_MAX, DESCRIPTION_PART_HEAD_BYTES, DescriptionPart, RecordPart, ReplicaFrame};
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};
pub use rohrpost_network::{
    ALIVE_BYTES, FRAGMENT_HEAD_BYTES, FRAME_HEAD_BYTES as HEAD_BYTES, RECORD_PART_HEAD_BYTES, REFUSAL_BYTES,
};

/// Fragments of a package, at most: one of 64 KiB in the smallest datagrams has fewer.
pub const PARTS_MAX: u16 = 256;
const MAGIC: [u8; 2] = *b"Rp";
/// A million datagrams a second reach it after nine years; so a sequence and a place in its datagram fit in 64 bits.
pub const SEQUENCE_MAX: u64 = SEQUENCES - 1;
/// Offset of the check in a head.
pub(crate) const CHECK: std::ops::Range<usize> = 32..36;

/// A node by its place in the configuration, from 0.
pub type NodeIndex = u8;

/// Kind of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum FrameKind {
    /// Whole packages, one after the other.
    Packages = 1,
    /// A fragment of a package.
    Fragment = 2,
    /// Keep-alive.
    Alive = 3,
    /// The sender takes nothing from the receiver.
    Refusal = 4,
    /// Always sealed: a challenge, or the response to it.
    Hello = 5,
    /// A part of a record of a stream.
    RecordPart = 6,
    /// A part of the description of a stream's module.
    Description = 7,
    /// Asks for parts of a record again.
    PartRequest = 8,
    /// Time: the master's present time.
    Sync = 16,
    /// Time: warms the path for the next frame; empty.
    WarmUp = 17,
    /// Time: a slave measures the delay.
    Request = 18,
    /// Time: the master's answer.
    Reply = 19,
}

impl FrameKind {
    pub(crate) const ALL: [Self; 12] = [
        Self::Packages,
        Self::Fragment,
        Self::Alive,
        Self::Refusal,
        Self::Hello,
        Self::RecordPart,
        Self::Description,
        Self::PartRequest,
        Self::Sync,
        Self::WarmUp,
        Self::Request,
        Self::Reply,
    ];
}

/// The head of every datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameHead {
    /// What it is.
    pub kind: FrameKind,
    /// System of sender and receiver.
    pub system: u8,
    /// Node that sent it.
    pub from: NodeIndex,
    /// Node it is for.
    pub to: NodeIndex,
    /// Digest of the sender's configuration.
    pub digest: u64,
    /// Distinguishes this incarnation of the sending router from its others; never 0.
    pub incarnation: u64,
    /// Counts the datagrams of this incarnation from this sender to this port of the receiver, up to [`SEQUENCE_MAX`];
    /// where nothing is sealed from [`Port::first_sequence`] on.
    pub sequence: u64,
}

impl FrameHead {
    /// The 36 bytes before `rest`, which is all that follows, in pieces.
    pub fn to_bytes(&self, rest: &[&[u8]]) -> [u8; HEAD_BYTES] {
        let mut bytes = [0; HEAD_BYTES];
        self.write(0, &mut bytes);
        let check = check(&bytes, rest);
        bytes[CHECK].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    /// Writes all but the check to the beginning of a datagram. `key`: the key of its seal.
    pub(crate) fn write(&self, key: u8, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&MAGIC);
        bytes[2..8].copy_from_slice(&[VERSION, self.kind as u8, self.system, self.from, self.to, key]);
        bytes[8..16].copy_from_slice(&self.digest.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.incarnation.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.sequence.to_le_bytes());
    }

    /// Reads the head. The rest is returned as it is, see [`Frame::parse`].
    ///
    /// # Errors
    /// [`BadFrame`]
    pub fn parse(datagram: &[u8]) -> Result<(Self, &[u8]), BadFrame> {
        let (head, key) = Self::read(datagram)?;
        if key != 0 {
            return Err(BadFrame::Sealed);
        }
        Ok((head, &datagram[HEAD_BYTES..]))
    }

    /// Reads the head, and the key of the seal over the rest; 0: none.
    pub fn read(datagram: &[u8]) -> Result<(Self, u8), BadFrame> {
        let (b, rest) = datagram.split_first_chunk::<HEAD_BYTES>().ok_or(BadFrame::Foreign)?;
        if b[0..2] != MAGIC {
            return Err(BadFrame::Foreign);
        }
        if b[CHECK] != check(b, &[rest]).to_le_bytes() {
            return Err(BadFrame::Damaged("the check differs"));
        }
        if b[2] != VERSION && b[3] != FrameKind::Refusal as u8 {
            return Err(BadFrame::Version(b[2]));
        }
        let kind = FrameKind::ALL.into_iter().find(|it| *it as u8 == b[3]).ok_or(BadFrame::Damaged("unknown kind"))?;
        let head = Self {
            kind,
            system: b[4],
            from: b[5],
            to: b[6],
            digest: long(b, 8),
            incarnation: long(b, 16),
            sequence: long(b, 24),
        };
        if head.incarnation == 0 {
            return Err(BadFrame::Damaged("incarnation 0"));
        }
        let key = b[7];
        let is_of_a_port = |port: &Port| port.has_sequence(head.sequence);
        if head.sequence > SEQUENCE_MAX && (key != 0 || !Port::ALL.iter().any(is_of_a_port)) {
            return Err(BadFrame::Damaged("a sequence that no router reaches"));
        }
        Ok((head, key))
    }
}

/// Receiver and sequence of a written head.
///
/// # Panics
/// If there is none.
pub(crate) fn place_of(datagram: &[u8]) -> (NodeIndex, u64) {
    let (head, _) = datagram.split_first_chunk::<HEAD_BYTES>().expect("a datagram has a head");
    (head[6], long(head, 24))
}

/// Offset of the digest in a head.
pub(crate) const DIGEST_AT: u32 = 8;

/// The first four bytes of a datagram of a kind, of this version.
pub(crate) fn beginning(kind: FrameKind) -> [u8; 4] {
    [MAGIC[0], MAGIC[1], VERSION, kind as u8]
}

/// Writes the key of the seal into a head.
pub fn write_key(key: u8, datagram: &mut [u8]) {
    datagram[7] = key;
}

/// The part of a head that check and seal cover.
pub(crate) fn before_check(head: &[u8]) -> &[u8] {
    &head[..CHECK.start]
}

/// Writes the check of an otherwise complete datagram.
pub fn write_check(datagram: &mut [u8]) {
    if let Some((head, rest)) = datagram.split_first_chunk_mut::<HEAD_BYTES>() {
        let check = check(head, &[rest]);
        head[CHECK].copy_from_slice(&check.to_le_bytes());
    }
}

/// The check of a datagram.
pub(crate) fn check(head: &[u8; HEAD_BYTES], rest: &[&[u8]]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(before_check(head));
    rest.iter().for_each(|part| hasher.update(part));
    hasher.finalize()
}

/// Content of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Frame<'a> {
    /// Whole packages.
    Packages(Packages<'a>),
    /// A fragment of one.
    Fragment(Fragment<'a>),
    /// Keep-alive.
    Alive(Alive),
    /// The sender takes nothing from the receiver.
    Refusal(Refusal),
    /// Of a replica.
    Replica(ReplicaFrame<'a>),
    /// A message of the time protocol; `time` parses it.
    Time(&'a [u8]),
}

impl<'a> Frame<'a> {
    /// Checks all claims of a datagram.
    ///
    /// # Errors
    /// [`BadFrame`]
    pub fn parse(datagram: &'a [u8]) -> Result<(FrameHead, Self), BadFrame> {
        let (head, rest) = FrameHead::parse(datagram)?;
        Ok((head, Self::read(head.kind, datagram[2], rest)?))
    }

    /// Reads the rest after a head, as a router of a `version` wrote it.
    pub(crate) fn read(kind: FrameKind, version: u8, rest: &'a [u8]) -> Result<Self, BadFrame> {
        Ok(match kind {
            FrameKind::Packages => Self::Packages(Packages::check(rest)?),
            FrameKind::Fragment => Self::Fragment(Fragment::parse(rest)?),
            FrameKind::Alive => Self::Alive(Alive::parse(rest)?),
            FrameKind::Refusal => Self::Refusal(Refusal::parse(version, rest)?),
            FrameKind::RecordPart => Self::Replica(ReplicaFrame::Record(RecordPart::parse(rest)?)),
            FrameKind::Description => Self::Replica(ReplicaFrame::Description(DescriptionPart::parse(rest)?)),
            FrameKind::PartRequest => Self::Replica(ReplicaFrame::Request(PartRequestBytes::parse(rest)?)),
            FrameKind::Hello => return Err(BadFrame::Damaged("a hello that is not sealed")),
            FrameKind::Sync | FrameKind::WarmUp | FrameKind::Request | FrameKind::Reply => Self::Time(rest),
        })
    }
}

/// Iterator over the packages of a datagram. Checked as a whole: at least one, none cut short, nothing behind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Packages<'a> {
    rest: &'a [u8],
}

impl<'a> Packages<'a> {
    fn check(bytes: &'a [u8]) -> Result<Self, BadFrame> {
        let mut rest = bytes;
        while let Some((_, _, behind)) = split_package(rest) {
            rest = behind;
        }
        if bytes.is_empty() || !rest.is_empty() {
            return Err(BadFrame::Damaged("a package is cut short"));
        }
        Ok(Self { rest: bytes })
    }
}

impl<'a> Iterator for Packages<'a> {
    type Item = (Head, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (head, body, rest) = split_package(self.rest)?;
        self.rest = rest;
        Some((head, body))
    }
}

fn split_package(bytes: &[u8]) -> Option<(Head, &[u8], &[u8])> {
    let head = Head::from_bytes(bytes).ok()?;
    let (body, rest) = bytes.get(PACKAGE_HEAD_BYTES..)?.split_at_checked(head.len.into())?;
    Some((head, body, rest))
}

/// A fragment of a package that does not fit in a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fragment<'a> {
    /// Sequence of the datagram with the first fragment: identifies the package, and its place in the order.
    pub first: u64,
    /// Index of the fragment, from 0.
    pub index: u16,
    /// Number of fragments.
    pub count: u16,
    /// Offset of these bytes in the body.
    pub offset: u32,
    /// The package's head; its `len` is that of the whole body.
    pub head: Head,
    /// Content of the fragment.
    pub bytes: &'a [u8],
}

impl<'a> Fragment<'a> {
    /// Its head, to go before the bytes.
    pub fn head_bytes(&self) -> [u8; FRAGMENT_HEAD_BYTES] {
        let mut bytes = [0; FRAGMENT_HEAD_BYTES];
        bytes[0..8].copy_from_slice(&self.first.to_le_bytes());
        bytes[8..10].copy_from_slice(&self.index.to_le_bytes());
        bytes[10..12].copy_from_slice(&self.count.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.offset.to_le_bytes());
        bytes[16..32].copy_from_slice(&self.head.to_bytes());
        bytes
    }

    pub(crate) fn parse(rest: &'a [u8]) -> Result<Self, BadFrame> {
        let Some((b, bytes)) = rest.split_first_chunk::<FRAGMENT_HEAD_BYTES>() else {
            return Err(BadFrame::Damaged("a fragment is cut short"));
        };
        let half = |at: usize| u16::from_le_bytes([b[at], b[at + 1]]);
        let offset = u32::from_le_bytes([b[12], b[13], b[14], b[15]]);
        let Ok(head) = Head::from_bytes(&b[16..]) else { return Err(BadFrame::Damaged("a fragment is cut short")) };
        let part = Self { first: long(b, 0), index: half(8), count: half(10), offset, head, bytes };
        if part.is_sound() { Ok(part) } else { Err(BadFrame::Damaged("a fragment lies outside its package")) }
    }

    /// Bytes of each fragment but the last.
    pub fn part_bytes(&self) -> usize {
        if self.is_last() { self.offset as usize / usize::from(self.index).max(1) } else { self.bytes.len() }
    }

    /// The first bytes of the body, as far as they are here.
    pub(crate) fn beginning(&self) -> &'a [u8] {
        if self.index == 0 { self.bytes } else { &[] }
    }

    fn is_last(&self) -> bool {
        usize::from(self.index) + 1 == usize::from(self.count)
    }

    /// All fragments but the last have one size, so that each index once makes the body without gap or overlap.
    fn is_sound(&self) -> bool {
        let (part, len, index) = (self.part_bytes(), usize::from(self.head.len), usize::from(self.index));
        let begins = usize::try_from(self.offset).ok() == index.checked_mul(part);
        let is_part = self.index < self.count && (2..=PARTS_MAX).contains(&self.count) && self.first <= SEQUENCE_MAX;
        let length = if self.is_last() { len.saturating_sub(index * part) } else { part };
        is_part && begins && part > 0 && len.div_ceil(part) == self.count.into() && self.bytes.len() == length
    }
}

/// Keep-alive with a report on the receiver: reveals one-way links, and losses at the end of a burst.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Alive {
    /// The receiver's incarnation that is heard; 0: none.
    pub heard_incarnation: u64,
    /// The next sequence that is expected of it.
    pub heard_next: u64,
    /// Datagrams of that incarnation that never came.
    pub heard_lost: u64,
}

impl Alive {
    /// The 24 bytes behind the head.
    pub fn to_bytes(&self) -> [u8; ALIVE_BYTES] {
        let mut bytes = [0; ALIVE_BYTES];
        bytes[0..8].copy_from_slice(&self.heard_incarnation.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.heard_next.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.heard_lost.to_le_bytes());
        bytes
    }

    fn parse(rest: &[u8]) -> Result<Self, BadFrame> {
        let b: &[u8; ALIVE_BYTES] = rest.try_into().map_err(|_| BadFrame::Damaged("an alive frame has 24 bytes"))?;
        Ok(Self { heard_incarnation: long(b, 0), heard_next: long(b, 8), heard_lost: long(b, 16) })
    }
}

#[cfg(test)]
mod tests;
