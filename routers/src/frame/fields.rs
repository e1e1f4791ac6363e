//! What all kinds of datagrams have in common: numbers at fixed places, and why bytes are none.

/// Version of this format. The first four bytes, the check and a refusal are the same in all.
pub const VERSION: u8 = 2;

/// Why bytes are no valid frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadFrame {
    /// Something else, or cut short.
    #[error("no datagram of a Rohrpost router")]
    Foreign,
    /// Another version of the format.
    #[error("wire format {theirs}, ours is {VERSION}; run the same version of Rohrpost on all nodes", theirs = .0)]
    Version(u8),
    /// Sealed, but no seal is expected here.
    #[error("sealed, and this node's configuration says `security = \"none\"`; launch all nodes from the same file")]
    Sealed,
    /// This format, but malformed.
    #[error("damaged: {0}")]
    Damaged(&'static str),
}

/// Two bytes at an offset that the caller's array has.
pub(super) fn half<const N: usize>(bytes: &[u8; N], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// Four bytes, as above.
pub(super) fn word<const N: usize>(bytes: &[u8; N], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Eight bytes at an offset that the caller's array has.
pub(crate) fn long<const N: usize>(bytes: &[u8; N], at: usize) -> u64 {
    let mut eight = [0; 8];
    eight.copy_from_slice(&bytes[at..at + 8]);
    u64::from_le_bytes(eight)
}
