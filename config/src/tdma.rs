//! Time slots: who may send when, sections `[tdma]` and `[[slot]]` (seed 002, section 4).
//!
//! Time is divided into cycles of equal length; cycle n begins when system time is n times that length. A cycle begins with a window for
//! each master's synchronisation; behind them lie the slots of the nodes. Who sends ends the guard before its slot does, so that
//! clocks that differ by less than the guard never have two nodes on the wire at once.

use std::time::Duration;

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
    /// Line in the file.
    pub line: usize,
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
    /// Line in the file.
    pub line: usize,
}
