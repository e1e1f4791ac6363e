//! Streams of one node on others, record by record: a replica.
//!
//! ```text
//!  ring of the origin ─▶ ReplicaSender: by level, part by part ═ UDP ═▶ ReplicaReceiver ─▶ begun record ─▶ ring there
//!        held while a part is copied   ▲        description, each second │        all parts came: it is a record
//!                                      └══════ UDP: which are missing ◀══┤ one is missing: it is asked for
//!                                                                        └ and never comes: left out, and told so
//! ```
//!
//! The rings are the queues: nothing waits besides, on either end. A part is copied from the ring into its datagram
//! when the wire has room, and from the datagram into the ring. Sequence, incarnation and stamp stay the origin's.
//!
//! Lost parts are asked for, within bounds on both ends:
//!
//! - The receiver has two records of a replica open at most, of small ones up to eight: older ones that were asked for
//!   or reordered, and a newer one that arrives. One too many, or the replica's deadline, ends the oldest; a newer one
//!   that is whole waits for older ones as long as an answer takes. Of a record of which nothing came it knows by the
//!   next one, since that says which was sent before: what was left out on purpose is never asked for. This is worth it
//!   for small records, too: it costs one request for a lost pose, and delays the next pose by one round trip.
//! - It asks when the last part that is expected came, when a newer record begins, or when nothing came for the time
//!   that an answer takes, measured; again after that time, then twice, then four times that time. At most 32 times for
//!   a record after the last part of it that came by itself, and at most 500 requests a second for a replica.
//! - The sender sends asked parts before new ones of the same stream, at its level, and as all parts do. It takes them
//!   from the ring, of the last 32 records that it sent to that node. All parts of a record in sum leave again at most
//!   as often as it has parts, and eight times more. Parts that have not left yet are not sent twice. Of a record that
//!   was overwritten nothing is sent: newer ones are under way, which end it at the receiver.
//!
//! No socket, thread or clock here, and no type: what a record means stands in the description of its module, which
//! goes along unread. Rings are memory of this node; making one and laying down a description are system calls, a part
//! is none.

mod again;
mod alarms;
mod answer_time;
mod by_level;
mod counts;
mod description;
mod destination;
mod fingerprint;
mod gathering;
mod incoming;
mod line;
mod one_way;
mod outgoing;
mod receiving;
mod requests;
mod sending;
mod settings;
#[cfg(test)]
mod tests;

pub use counts::{ReceivedReplica, ReplicaCounts, ReplicaLoss, ReplicaLosses, SentReplica};
pub use line::{LineReplicas, TellsTime};
pub use one_way::{MeasuredRoundTrip, OneWayClock};
pub use receiving::ReplicaReceiver;
pub use requests::PartRequests;
pub use rohrpost_network::LINE_PART_BYTES;
pub use sending::{ReplicaSender, ReplicaStep};
pub use settings::{LineSettings, ReplicaSettings};

use crate::frame::{self, RECORD_PART_HEAD_BYTES};
use crate::settings::Settings;

/// Descriptions are sent this often to each node that has a replica.
pub const DESCRIBE_EVERY_NS: u64 = 1_000_000_000;

/// A part with its head, at most.
pub const LINE_PART_ROOM: usize = RECORD_PART_HEAD_BYTES + LINE_PART_BYTES;
/// Descriptions are sent when a node comes and when they change; and this often, if the other end could not use one.
const LINE_DESCRIBE_EVERY_NS: u64 = 10_000_000_000;

/// Reads what this crate does not know: by the description of a module, the number of its stream of this name; none: it
/// has no such stream.
pub type Describe = dyn Fn(&[u8], &str) -> Option<u16> + Send + Sync;

/// Bytes of each part of a record but the last: what a datagram has room for. Equal on all nodes.
fn part_bytes(settings: &Settings) -> usize {
    settings.network.datagram_bytes_max - frame::HEAD_BYTES - RECORD_PART_HEAD_BYTES
}
