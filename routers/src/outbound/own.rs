//! Reads datagrams that this router itself made.

use crate::frame::{self, FrameKind, NodeIndex};

/// Kind, receiver and body of a datagram of this router. One that is to be sealed has no check yet.
pub(crate) fn kind_of_own(datagram: &[u8]) -> Option<(FrameKind, NodeIndex, &[u8])> {
    let (head, rest) = datagram.split_first_chunk::<{ frame::HEAD_BYTES }>()?;
    let kind = FrameKind::ALL.into_iter().find(|kind| *kind as u8 == head[3])?;
    Some((kind, head[6], rest))
}
