//! Parts of replicas, as an end of a session sends them.

use super::ReplicaEnd;
use super::frame::SessionFrameKind;
use super::outgoing::Outgoing;
use crate::frame::{FrameKind, NodeIndex};
use crate::replication::LINE_PART_ROOM;

/// Makes the next part for a node ready, if the line has room and there is one. Whether more wait behind it: what
/// measures how fast the line is must know.
pub(super) fn add_part(outgoing: &mut Outgoing, now_ns: u64, node: NodeIndex, end: &mut impl ReplicaEnd) -> bool {
    let Some(replicas) = end.replicas() else { return false };
    outgoing.add_part(LINE_PART_ROOM, |content| {
        let (kind, length) = replicas.next(now_ns, node, content)?;
        let is_record = kind == FrameKind::RecordPart;
        Some((if is_record { SessionFrameKind::RecordPart } else { SessionFrameKind::Description }, length))
    });
    replicas.waits_for(now_ns, node)
}
