//! A router's time slots, seen by tools.

use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// How a node keeps its time slots. Counts are since its router began, and only grow.
///
/// Tools, charts and the book take names, units and texts from here, by [`quantities`](rohrpost_schema::quantities).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SlotState {
    /// The node.
    pub node: String,
    /// Slots in which something was sent.
    #[schema(unit = "slots")]
    pub used: u64,
    /// Slots in which nothing had to be sent.
    #[schema(unit = "slots")]
    pub empty: u64,
    /// Slots that were left out because the router woke up too late for them.
    #[schema(unit = "slots")]
    pub late: u64,
    /// Slots that went by while the router stood still.
    #[schema(unit = "slots")]
    pub skipped: u64,
    /// Slots without packages because the time was not sure enough.
    #[schema(unit = "slots")]
    pub silent: u64,
    /// Why it does not send now; empty if it does.
    pub why_silent: String,
    /// Datagrams in slots and synchronisation windows.
    #[schema(unit = "datagrams")]
    pub datagrams: u64,
    /// Bytes of these datagrams on the wire, all heads counted.
    #[schema(unit = "bytes")]
    pub wire_bytes: u64,
    /// Cycles in which it synchronised the others as the master.
    #[schema(unit = "cycles")]
    pub synchronisations_sent: u64,
    /// Cycles in which it synchronised the others in a silent master's place.
    #[schema(unit = "cycles")]
    pub replacements_sent: u64,
    /// Cycles in which the master's synchronisation came.
    #[schema(unit = "cycles")]
    pub synchronisations_heard: u64,
    /// Cycles in which a backup's synchronisation came.
    #[schema(unit = "cycles")]
    pub replacements_heard: u64,
    /// Cycles in which no synchronisation came.
    #[schema(unit = "cycles")]
    pub synchronisations_missed: u64,
    /// Cycles in which it did not synchronise the others as the master because it woke up too late.
    #[schema(unit = "cycles")]
    pub synchronisations_late: u64,
    /// Datagrams that missed the end of their slot because the router stood still just then: they waited for the next
    /// one.
    #[schema(unit = "datagrams")]
    pub held: u64,
    /// Slots and synchronisation windows that were over when the call for their last datagram came back: the router
    /// stood still in it, and the datagram may have left outside.
    #[schema(unit = "slots")]
    pub overran: u64,
    /// Slots that began too late, or took too long, for what bounds assume: packages may have waited for the next one.
    #[schema(unit = "slots")]
    pub behind: u64,
    /// Hellos that it sent, without a time of its own, by the time of an unverified node: some when it joins, more
    /// while recorded datagrams are repeated.
    #[schema(unit = "hellos")]
    pub unproven: u64,
    /// Changes of role: slave, master.
    #[schema(unit = "changes")]
    pub roles: u64,
    /// From the router's call to the wire, the median.
    #[schema(unit = "ns")]
    pub lead_ns: u64,
    /// Ordinary traffic through the tunnel; none without one.
    pub tunnel: Option<TunnelState>,
    /// How the kernel schedules the thread that keeps the slots: `deadline`, `fifo` or `ordinary`.
    pub scheduled: String,
    /// The last slots and windows that were used, the oldest first.
    pub last: Vec<SlotUse>,
}

/// What ordinary traffic did in a tunnel. Counts are since its router began, and only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TunnelState {
    /// Packets taken from the kernel for other nodes.
    #[schema(unit = "packets")]
    pub sent: u64,
    /// Packets for other nodes that were dropped, since too many waited.
    #[schema(unit = "packets")]
    pub dropped: u64,
    /// Packets for no node, or not of IPv4.
    #[schema(unit = "packets")]
    pub stray: u64,
    /// Packets from other nodes, handed to the kernel.
    #[schema(unit = "packets")]
    pub received: u64,
    /// Packets from other nodes that the kernel did not take.
    #[schema(unit = "packets")]
    pub refused: u64,
}

/// A slot or synchronisation window that was used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SlotUse {
    /// The slot, by its place in the configuration's table; none: the window of synchronisation.
    pub slot: Option<u16>,
    /// Beginning and end of sending, system time, ns since 1970.
    pub begin_ns: u64,
    /// See `begin_ns`.
    pub end_ns: u64,
    /// The first datagram was on the wire so long after the beginning, ns.
    pub off_ns: i64,
    /// Whether the kernel's stamp says so; else it is reckoned.
    pub by_kernel: bool,
    /// Datagrams in it.
    pub datagrams: u64,
}
