//! Streams of one node on others, record by record: a replica.
//!
//! ```text
//!  ring of the origin ─▶ ReplicaSender: by level, part by part ═ UDP ═▶ ReplicaReceiver ─▶ begun record ─▶ ring there
//!        held while a part is copied            description, each second │        all parts came: it is a record
//!                                                                        └ one is missing: left out, and told so
//! ```
//!
//! The rings are the queues: nothing waits besides, on either end. A part is copied from the ring into its datagram
//! when the wire has room, and from the datagram into the ring. Sequence, incarnation and stamp stay the origin's.
//!
//! No socket, thread or clock here, and no type: what a record means stands in the description of its module, which
//! goes along unread. Rings are memory of this node; making one and laying down a description are system calls, a part
//! is none.

mod assembly;
mod counts;
mod destination;
mod fingerprint;
mod receiving;
mod sending;
mod settings;
#[cfg(test)]
mod tests;

pub use counts::{ReceivedReplica, ReplicaCounts, ReplicaLoss, ReplicaLosses, SentReplica};
pub use receiving::ReplicaReceiver;
pub use sending::{ReplicaSender, ReplicaStep};
pub use settings::ReplicaSettings;

use crate::frame::{self, RECORD_PART_HEAD_BYTES};
use crate::settings::Settings;

/// Descriptions are sent this often to each node that has a replica.
pub const DESCRIBE_EVERY_NS: u64 = 1_000_000_000;

/// Reads what this crate does not know.
pub trait Describe: Send + Sync {
    /// The number of the stream of this name, by the description of its module; none: it has no such stream.
    fn number(&self, description: &[u8], item: &str) -> Option<u16>;
}

/// Bytes of each part of a record but the last: what a datagram has room for. Equal on all nodes.
fn part_bytes(settings: &Settings) -> usize {
    settings.network.datagram_bytes_max - frame::HEAD_BYTES - RECORD_PART_HEAD_BYTES
}

/// CRC-32 (of zlib) of a description.
fn check(description: &[u8]) -> u32 {
    crc32fast::hash(description)
}
