//! Spans of time that plans are made of, and by which they are checked.

use rohrpost_routers::inbound::REFUSE_EVERY_NS;
use rohrpost_routers::link::REFUSED_FOR_NS;

/// Microseconds, milliseconds and seconds in ns.
pub(crate) const US: u64 = 1_000;
pub(crate) const MS: u64 = 1_000_000;
pub(crate) const S: u64 = 1_000_000_000;

/// So long after the last fault everything must be as if there had been none: every call answered, nothing lost. A
/// datagram that went astray is refused up to a second later, and a refusal holds for three.
pub(crate) const RECOVERY_NS: u64 = REFUSE_EVERY_NS + REFUSED_FOR_NS + S / 4;
/// So long all must be well.
pub(crate) const WELL_NS: u64 = 3 * S / 2;
/// After the last package all has been delivered or counted within this time: what may wait, waits 2 s at most.
pub(crate) const DRAIN_NS: u64 = 7 * S / 2;

/// A datagram takes so long on the wire at most: with the longest waits in a router and in a socket, less than the 2 s
/// that "at most once" relies on.
pub(crate) const WIRE_NS_MAX: u64 = 100 * MS;

/// So many intervals after the last fault, and one for each that may be master, all nodes follow one.
pub(crate) const TIMED_INTERVALS: u64 = 12;

/// Nodes of two parts that were far off each other step, but a master begins an epoch only after such a pause.
pub(crate) const EPOCH_PAUSE_NS: u64 = 10 * S;
