//! Time slots: who may send when (seed 002, section 4).
//!
//! Time is divided into cycles of equal length; cycle n begins when system time is n times that length. A cycle begins with a window for
//! each master's synchronisation; behind them lie the slots of the nodes. Who sends ends the guard before its slot does, so that
//! clocks that differ by less than the guard never have two nodes on the wire at once.

use std::net::Ipv4Addr;
use std::time::Duration;

/// Bounds allow for slots that are begun so late.
pub const LATE: Duration = Duration::from_micros(50);
/// A slot is begun so late at most; later it is left unused. What is begun after [`LATE`] may not carry all that bounds reckon with.
pub const GATE: Duration = Duration::from_micros(100);

/// The slot table of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tdma {
    /// From the beginning of one cycle to that of the next.
    pub cycle: Duration,
    /// Window of each master's synchronisation: that of the first master begins the cycle, the others' follow in their order.
    pub synchronisation: Duration,
    /// The end of each slot and window in which nobody sends.
    pub guard: Duration,
    /// Bytes a second that every link carries, the heads of Ethernet, IP and UDP counted.
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
    /// It is there in each so many-th cycle, 1 or more.
    pub period: u32,
    /// In which of them, 0 up to the period less 1: those cycles whose number divided by the period leaves it.
    pub phase: u32,
}

/// An IPv4 network whose packets go from node to node in the slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tunnel {
    /// Its address: that of no node.
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

    /// Bytes that may leave in a slot or window of a length: those that the link carries before the guard begins, the heads of Ethernet,
    /// IP and UDP counted.
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
