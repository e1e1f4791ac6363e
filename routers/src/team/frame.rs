//! Bytes of a datagram between systems: checked once, then no accessor can fail. The page `docs/src/wire.md` is exact.
//!
//! ```text
//!  0     2    3    4       5     6   7    8        16            24         32      36
//! ┌──────┬────┬────┬───────┬─────┬───┬────┬────────┬─────────────┬──────────┬───────┬────────────────────────────┐
//! │ "Rt" │ v1 │kind│system │node │to │key │ common │ incarnation │ sequence │ check │ a package's head and body, │
//! └──────┴────┴────┴───────┴─────┴───┴────┴────────┴─────────────┴──────────┴───────┤ or a beat; if sealed, tag  │
//!                                                                                   └────────────────────────────┘
//!  beat: challenge u64, sent u64, count u8, 7 × 0, count × (system u8, node u8, 2 × 0, challenge u64)
//! ```
//!
//! Little-endian; a package head has the order of its options. Check and seal are those of the datagrams on the LAN.

use crate::frame::{self, CHECK, HEAD_BYTES, NodeIndex, long};
use rohrpost_mailbox::{ALL_SYSTEMS, HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

/// Version of this format. The first three bytes and the check are the same in all.
pub const TEAM_VERSION: u8 = 1;
/// Longest body of a package that goes to other systems: the records of a team, 16 384 bytes, with what stands before
/// them in a package. One datagram carries it; IP splits what is longer than a packet of the network.
pub const TEAM_BODY_BYTES_MAX: usize = 16_384 + 128;
/// Longest datagram.
pub const TEAM_DATAGRAM_BYTES_MAX: usize =
    HEAD_BYTES + PACKAGE_HEAD_BYTES + TEAM_BODY_BYTES_MAX + crate::security::TAG_BYTES;
/// Echoes in a beat: with these it is one packet on Ethernet.
pub const ECHOES_MAX: usize = 112;
const MAGIC: [u8; 2] = *b"Rt";
const BEAT_BYTES: usize = 24;
const ECHO_BYTES: usize = 12;

const _: () = assert!(HEAD_BYTES + BEAT_BYTES + ECHOES_MAX * ECHO_BYTES + 16 <= 1500 - 28, "a beat is one packet");
const _: () = assert!(TEAM_DATAGRAM_BYTES_MAX <= 65_507, "UDP has no longer datagrams");

/// Kind of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum TeamKind {
    /// One package.
    Package = 1,
    /// Says that its sender lives, and what it hears.
    Beat = 2,
}

/// The head of every datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TeamHead {
    /// What follows.
    pub kind: TeamKind,
    /// System that sent it, 1 to 254.
    pub system: u8,
    /// Node there that sent it.
    pub node: NodeIndex,
    /// System that it is for; 255: all.
    pub to: u8,
    /// Digest of the classes that the sender knows; 0: it does not say.
    pub common: u64,
    /// Distinguishes this incarnation of the sending router from its others; never 0.
    pub incarnation: u64,
    /// Counts the datagrams of this incarnation.
    pub sequence: u64,
}

/// Why bytes are no datagram of a team.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BadTeamFrame {
    /// Something else, or cut short.
    Foreign,
    /// Another version of the format.
    Version(u8),
    /// This format, but malformed.
    Damaged,
}

impl TeamHead {
    /// Writes a head without check to the beginning of a datagram, which has room for it.
    pub fn write(&self, datagram: &mut [u8]) {
        datagram[0..2].copy_from_slice(&MAGIC);
        datagram[2..8].copy_from_slice(&[TEAM_VERSION, self.kind as u8, self.system, self.node, self.to, 0]);
        datagram[8..16].copy_from_slice(&self.common.to_le_bytes());
        datagram[16..24].copy_from_slice(&self.incarnation.to_le_bytes());
        datagram[24..32].copy_from_slice(&self.sequence.to_le_bytes());
    }

    /// Reads a head, and the key of the seal over the rest; 0: none.
    ///
    /// # Errors
    /// [`BadTeamFrame`]
    pub fn read(datagram: &[u8]) -> Result<(Self, u8), BadTeamFrame> {
        let (b, rest) = datagram.split_first_chunk::<HEAD_BYTES>().ok_or(BadTeamFrame::Foreign)?;
        if b[0..2] != MAGIC {
            return Err(BadTeamFrame::Foreign);
        }
        if b[CHECK] != frame::check(b, &[rest]).to_le_bytes() {
            return Err(BadTeamFrame::Damaged);
        }
        if b[2] != TEAM_VERSION {
            return Err(BadTeamFrame::Version(b[2]));
        }
        let kind = [TeamKind::Package, TeamKind::Beat].into_iter().find(|kind| *kind as u8 == b[3]);
        let kind = kind.ok_or(BadTeamFrame::Damaged)?;
        let (common, incarnation, sequence) = (long(b, 8), long(b, 16), long(b, 24));
        let head = Self { kind, system: b[4], node: b[5], to: b[6], common, incarnation, sequence };
        let is_sound = (1..ALL_SYSTEMS).contains(&head.system)
            && head.to != 0
            && usize::from(head.node) < rohrpost_network::NODES_MAX
            && incarnation != 0
            && sequence < u64::MAX / 2;
        if is_sound { Ok((head, b[7])) } else { Err(BadTeamFrame::Damaged) }
    }
}

/// Reads the text of a package: its head and its body, as long as the head says.
pub(super) fn package(text: &[u8]) -> Option<(Head, &[u8])> {
    let (head, body) = text.split_first_chunk::<PACKAGE_HEAD_BYTES>()?;
    let head = Head::from_bytes(head).ok()?;
    (usize::from(head.len) == body.len() && body.len() <= TEAM_BODY_BYTES_MAX).then_some((head, body))
}

/// The newest challenge of an incarnation that is heard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Echo {
    /// System of the incarnation.
    pub system: u8,
    /// Node in the sender's system.
    pub node: NodeIndex,
    /// What it said.
    pub challenge: u64,
}

/// Says that its sender lives, and what it hears.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Beat<'a> {
    /// A node that repeats this in a beat of its own has heard the sender since.
    pub challenge: u64,
    /// Datagrams to all systems that the incarnation has sent before this one.
    pub sent: u64,
    echoes: &'a [[u8; ECHO_BYTES]],
}

impl<'a> Beat<'a> {
    /// Reads the text of a beat; none if it is damaged.
    pub fn parse(text: &'a [u8]) -> Option<Self> {
        let (head, rest) = text.split_first_chunk::<BEAT_BYTES>()?;
        let (echoes, behind) = rest.as_chunks::<ECHO_BYTES>();
        let is_whole = behind.is_empty() && echoes.len() == usize::from(head[16]) && echoes.len() <= ECHOES_MAX;
        is_whole.then(|| Self { challenge: long(head, 0), sent: long(head, 8), echoes })
    }

    /// What the sender has heard.
    pub fn echoes(&self) -> impl Iterator<Item = Echo> + use<'a> {
        self.echoes.iter().map(|b| Echo { system: b[0], node: b[1], challenge: long(b, 4) })
    }

    /// Appends a beat to a datagram: with the first [`ECHOES_MAX`] echoes.
    pub fn write(challenge: u64, sent: u64, echoes: impl Iterator<Item = Echo>, into: &mut Vec<u8>) {
        let begin = into.len();
        into.extend(challenge.to_le_bytes());
        into.extend(sent.to_le_bytes());
        into.extend([0; 8]);
        for echo in echoes.take(ECHOES_MAX) {
            into.extend([echo.system, echo.node, 0, 0]);
            into.extend(echo.challenge.to_le_bytes());
            into[begin + 16] += 1;
        }
    }
}
