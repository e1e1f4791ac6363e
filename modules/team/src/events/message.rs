//! Bytes of an event between teammates. Layout: docs/src/wire.md.

use crate::bytes::{Malformed, Reader};
use crate::ids::RobotId;

/// Bytes of a message of an event at most: as of records.
pub const EVENT_BYTES_MAX: usize = 16_384;
/// Bytes before the payload.
pub const EVENT_HEAD_BYTES: usize = 16;

/// First byte of an event.
const KIND: u8 = b'E';
/// Second byte: changes with the layout.
const LAYOUT: u8 = 1;

/// What stands before the payload of an event that goes to teammates.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct EventHead {
    /// The sender.
    pub from: RobotId,
    /// Leaves that ran one after the other to cause it, on any robots; at least 1.
    pub depth: u8,
    /// Number of its type in the plan.
    pub event_type: u8,
    /// Step of the group at which it starts, in the walk over the tree.
    pub path: u16,
    /// Digest of the sender's tree.
    pub tree: u64,
}

impl EventHead {
    /// Bytes of the head; the payload follows.
    pub fn encode(&self) -> [u8; EVENT_HEAD_BYTES] {
        let mut bytes = [0; EVENT_HEAD_BYTES];
        bytes[..5].copy_from_slice(&[KIND, LAYOUT, self.from.get(), self.depth, self.event_type]);
        bytes[6..8].copy_from_slice(&self.path.to_le_bytes());
        bytes[8..].copy_from_slice(&self.tree.to_le_bytes());
        bytes
    }

    /// Reads a message: the head, and the payload's bytes.
    ///
    /// # Errors
    /// If the bytes are no event. Whether it fits a tree is checked by [`super::Tree::hear`].
    pub fn decode(bytes: &[u8]) -> Result<(Self, &[u8]), Malformed> {
        let mut reader = Reader::new(bytes);
        let [kind, layout] = reader.array()?;
        reader.check(kind == KIND && layout == LAYOUT, "an event begins with `E` and layout 1")?;
        let from = reader.robot()?;
        let [depth] = reader.array()?;
        reader.check(depth > 0, "the depth of an event is 1 to 255")?;
        let [event_type, zero] = reader.array()?;
        reader.check(zero == 0, "a byte is 0")?;
        let (path, tree) = (u16::from_le_bytes(reader.array()?), reader.u64()?);
        let payload = bytes.get(EVENT_HEAD_BYTES..).filter(|_| bytes.len() <= EVENT_BYTES_MAX);
        let payload = payload.ok_or(Malformed::Length { at: EVENT_BYTES_MAX })?;
        Ok((Self { from, depth, event_type, path, tree }, payload))
    }
}
