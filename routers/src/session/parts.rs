//! Parts of replicas, as an end of a session sends them.

use super::EndHost;
use super::frame::{HEAD_BYTES, SessionFrameKind};
use super::outgoing::Outgoing;
use crate::frame::{FrameKind, NodeIndex, RECORD_PART_HEAD_BYTES};
use crate::replication::LINE_PART_ROOM;
use rohrpost_network::LINE_PART_HEADS_BYTES;

const _: () = assert!(LINE_PART_HEADS_BYTES == HEAD_BYTES + RECORD_PART_HEAD_BYTES, "what `check` reckons with");

/// Makes the next part for a node ready, if the line has room and there is one, and no packages go first: those of its
/// own party that are as important, and a batch of any after each part. Whether one was made, and whether more wait
/// behind it: what measures how fast the line is must know.
pub(super) fn add_part(
    outgoing: &mut Outgoing,
    now_ns: u64,
    (node, party): (NodeIndex, u32),
    end: &mut impl EndHost,
) -> (bool, bool) {
    let Some(replicas) = end.replicas() else { return (false, false) };
    let is_made = outgoing.add_part((LINE_PART_ROOM, party), |level, content| {
        let (kind, length) = replicas.next_before(now_ns, (node, level), content)?;
        let is_record = kind == FrameKind::RecordPart;
        Some((if is_record { SessionFrameKind::RecordPart } else { SessionFrameKind::Description }, length))
    });
    (is_made, replicas.waits_for(now_ns, node))
}
