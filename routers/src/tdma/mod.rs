//! Time slots: when this node may send, and what it does when it does not know (seed 002, section 4).
//!
//! ```text
//!  Clock ─ system time, its bound ─▶ SlotScheduler ─ next ──▶ a window, in local time: when to wake, when to call ─▶ who sleeps and spins
//!  Table ─ windows in system time ─▶     │      ◀─ validate ── it is awake: now                                            │
//!                                        └──────── TransmitWindow ─▶ datagram after datagram, as long as the wire is free before the guard
//! ```
//!
//! A node sends in its own windows only, by its own clock, whether or not the last [`Sync`](crate::time::message::Sync) came. Two nodes are
//! never on the wire at once as long as each is off by half of the guard at most, its *allowance*. A node whose own bound is greater falls
//! silent, and says why. While others are heard, it may ask them what time it is, by the *coarse* time of their Syncs; it sends
//! nothing else.
//!
//! # What is assumed
//! That frames are sent in the order and at the time in which they are handed over, save for the *lead*, which is measured; that
//! [`Tdma::link_bytes_s`](rohrpost_network::Tdma::link_bytes_s) is true of all links; and of coarse time that the quickest of
//! the last eight Syncs took no longer than half of the guard.
//!
//! A bound is about the time of the master that a node follows. For the few cycles in which a new master is measured, some nodes may still go
//! by the time of the one before: two of them are then as far apart as their bounds and that of the new master together.
//!
//! # What who sends does
//! 1. [`SlotScheduler::next`]; sleep until [`Planned::wake_ns`], or until a datagram of time comes.
//! 2. Hand all datagrams of time that came to the [`Clock`](crate::time::Clock), so that it knows whether the master was heard. Spin until [`Planned::call_ns`].
//! 3. [`SlotScheduler::validate`]. With a [`TransmitWindow`]: as long as a datagram of time fits, [`Clock::poll_in`](crate::time::Clock::poll_in) with
//!    [`TransmitWindow::allowed`], until it waits. Then what must be said, then packages, each asked for by [`TransmitWindow::room_bytes`] and told by
//!    [`TransmitWindow::takes`]. At last [`SlotScheduler::close`].
//! 4. The kernel's stamp of the first datagram of a window goes to [`SlotScheduler::left`].

mod lead;
mod scheduler;
pub mod table;
#[cfg(test)]
mod tests;
mod tx_window;
pub mod wire;

pub use scheduler::{Counts, Next, Planned, Silent, SlotScheduler, Verdict};
pub use table::{Kind, Owner, Table, UNPROVEN_CYCLES, Window};
pub use tx_window::{Carries, TransmitWindow};
pub use wire::Wire;

/// Bounds reckon with slots that are begun so much after their beginning.
pub const LATE_NS: u64 = rohrpost_network::LATE.as_nanos() as u64;
/// A slot whose wake-up comes so much after its beginning is not used.
pub const GATE_NS: u64 = rohrpost_network::GATE.as_nanos() as u64;
