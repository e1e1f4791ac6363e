//! Time slots: when this node may send, and why it does not send.
//!
//! ```text
//!  Clock ─ system time, its bound ─▶ SlotScheduler ─ next ──▶ a window, in local time: when to wake and call ─▶ driver
//!  SlotTable ─ windows in system time ─▶ │      ◀─ validate ── it is awake: now                        sleeps, spins
//!                                        └────── TransmitWindow ─▶ datagrams, while the wire is free before the guard
//! ```
//!
//! A node sends in its own windows only, by its own clock, whether or not the last [`Sync`](crate::time::message::Sync)
//! came. Two nodes are never on the wire at once as long as each is off by half of the guard at most, its *allowance*.
//! A node with a greater bound falls silent and reports the reason. While it hears others, it may ask them for the
//! time, by the *coarse* time of their Syncs; it sends nothing else.
//!
//! # Assumptions
//! - Frames are sent in the order and at the time in which they are handed over, except for the *lead*, which is
//!   measured.
//! - [`Tdma::link_bytes_s`](rohrpost_network::Tdma::link_bytes_s) is true of all links.
//! - For coarse time: the fastest of the last eight Syncs took no longer than half of the guard.
//!
//! A bound is the distance from the time of the master that a node follows. For the few cycles in which a new master is
//! measured, some nodes may still follow the time of the one before. The distance of two such nodes is then at most the
//! sum of their bounds and the new master's.
//!
//! # What the driver does
//! 1. [`SlotScheduler::next`]; sleep until [`Planned::wake_ns`], or until a datagram of time comes.
//! 2. Hand all received datagrams of time to the [`Clock`](crate::time::Clock), so that it knows whether the master was
//!    heard.
//!    Spin until [`Planned::call_ns`].
//! 3. [`SlotScheduler::validate`]. With a [`TransmitWindow`]: as long as a datagram of time fits,
//!    [`Clock::poll_in`](crate::time::Clock::poll_in) with [`TransmitWindow::allowed`], until it waits. Then
//!    keep-alives, then packages. Ask [`TransmitWindow::room_bytes`] before each datagram, and call
//!    [`TransmitWindow::takes`] for it.
//!    At last [`SlotScheduler::close`].
//! 4. The kernel's stamp of the first datagram of a window goes to [`SlotScheduler::left`].

mod lead;
mod scheduler;
pub mod table;
#[cfg(test)]
mod tests;
mod tx_window;
pub mod wire;

pub use scheduler::{Next, Planned, Silent, SlotCounts, SlotScheduler, WindowVerdict};
pub use table::{Owner, SlotTable, UNPROVEN_CYCLES, Window, WindowKind};
pub use tx_window::{Carries, TransmitWindow};
pub use wire::Wire;

/// Bounds assume that slots begin at most this late.
pub const LATE_NS: u64 = rohrpost_network::LATE.as_nanos() as u64;
/// A slot is not used when the wake-up comes later than this after its beginning.
pub const GATE_NS: u64 = rohrpost_network::GATE.as_nanos() as u64;
