//! Time slots: the slot table.
//!
//! Time is divided into cycles of equal length; cycle n begins when system time is n times that length. A cycle begins
//! with a window for each master's synchronisation, then the slots of the nodes follow. A sender stops one guard before
//! its slot ends. So nodes with clocks that differ by less than the guard never send at the same time.

use std::net::Ipv4Addr;
use std::time::Duration;

/// Bounds assume that slots begin at most this late.
pub const LATE: Duration = Duration::from_micros(50);
/// A slot begins at most this late; later it is left unused. One that begins after [`LATE`] may carry less than the
/// bounds assume.
pub const GATE: Duration = Duration::from_micros(100);

/// The slot table of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tdma {
    /// From the beginning of one cycle to that of the next.
    pub cycle: Duration,
    /// Window of each master's synchronisation: that of the first master begins the cycle, the others' follow in order.
    pub synchronisation: Duration,
    /// The end of each slot and window, in which nothing is sent.
    pub guard: Duration,
    /// Bytes a second that every link carries, with headers of Ethernet, IP and UDP.
    pub link_bytes_s: u64,
    /// The slots, by offset, then by phase.
    pub slots: Vec<TimeSlot>,
    /// Addresses of the nodes for ordinary traffic, which crosses the network in their slots, behind all packages.
    pub tunnel: Option<Tunnel>,
}

/// A slot of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeSlot {
    /// The node, by its place in the file.
    pub node: u8,
    /// From the beginning of the cycle.
    pub offset: Duration,
    /// To its end, the guard included.
    pub length: Duration,
    /// Its period in cycles, 1 or more.
    pub period: u32,
    /// Its phase, from 0 to the period less 1: the remainder of the cycle's number divided by the period.
    pub phase: u32,
}

/// An IPv4 network; its packets travel between nodes in the slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tunnel {
    /// Its address: no node has it.
    pub network: Ipv4Addr,
    /// Bits that all its addresses share.
    pub prefix: u8,
}

impl Tunnel {
    /// The address of a node, by its place in the file.
    pub fn address(&self, node: u8) -> Ipv4Addr {
        Ipv4Addr::from_bits(self.network.to_bits() + u32::from(node) + 1)
    }
}

impl Tdma {
    /// Cycles after which the table repeats itself.
    pub fn cycles(&self) -> u64 {
        cycles(self.slots.iter())
    }

    /// Bytes that may leave in a slot or window of a length: as many as the link carries before the guard begins, with
    /// headers of Ethernet, IP and UDP.
    pub fn budget_bytes(&self, length: Duration) -> u64 {
        let ns = length.saturating_sub(self.guard).as_nanos();
        u64::try_from(ns * u128::from(self.link_bytes_s) / 1_000_000_000).unwrap_or(u64::MAX)
    }
}

impl TimeSlot {
    /// Whether it is there in a cycle.
    pub fn is_in(&self, cycle: u64) -> bool {
        cycle % u64::from(self.period.max(1)) == u64::from(self.phase)
    }
}

/// Cycles after which these slots repeat themselves.
pub(crate) fn cycles<'s>(slots: impl Iterator<Item = &'s TimeSlot>) -> u64 {
    slots.fold(1, |all: u64, slot| (all / common(all, slot.period.into())).saturating_mul(slot.period.into()))
}

/// Greatest common divisor.
pub(crate) fn common(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common(b, a % b) }
}
