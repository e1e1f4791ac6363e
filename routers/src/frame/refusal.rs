//! What a router answers of which it takes nothing.

use super::fields::{BadFrame, long};
use rohrpost_network::REFUSAL_BYTES;

/// Why a peer takes nothing from this node.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum RefusalReason {
    /// Another version of the wire format; the refusal's own version byte is theirs.
    Version = 1,
    /// Another configuration.
    Digest = 2,
    /// Its configuration has no such node, or that node has another address.
    Stranger = 3,
    /// One end seals, and the other does not.
    Sealed = 4,
    /// Sealed with another key. No refusal says so: each end finds it out by itself.
    Key = 5,
}

/// A refusal: the sender takes nothing from the receiver, and why.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// Wire version of the refusing router: the third byte of all its datagrams.
    pub version: u8,
    /// Why.
    pub reason: RefusalReason,
    /// Digest of the refusing router.
    pub digest: u64,
}

impl Refusal {
    /// The 16 bytes behind the head.
    pub fn to_bytes(&self) -> [u8; REFUSAL_BYTES] {
        let mut bytes = [0; REFUSAL_BYTES];
        bytes[0] = self.reason as u8;
        bytes[8..16].copy_from_slice(&self.digest.to_le_bytes());
        bytes
    }

    pub(super) fn parse(version: u8, rest: &[u8]) -> Result<Self, BadFrame> {
        let b: &[u8; REFUSAL_BYTES] = rest.try_into().map_err(|_| BadFrame::Damaged("a refusal has 16 bytes"))?;
        let reasons = [RefusalReason::Version, RefusalReason::Digest, RefusalReason::Stranger, RefusalReason::Sealed];
        let reason = reasons.into_iter().find(|reason| *reason as u8 == b[0]);
        let reason = reason.filter(|_| b[1..8] == [0; 7]).ok_or(BadFrame::Damaged("unknown reason of a refusal"))?;
        Ok(Self { version, reason, digest: long(b, 8) })
    }
}
