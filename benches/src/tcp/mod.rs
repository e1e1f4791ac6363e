//! Systems that meet at the TCP router: its real process, clients of nodes, and a crowd of sessions in one process of
//! the bench.
//!
//! ```text
//!  processor 0                                      processor 1
//!  crowd: 1000 sessions, one thread ═══ TCP ══════▶ TCP router            throughput and delay, beside other load
//!  ping ─▶ client of `near` ═══ TCP ══▶ TCP router ═══ TCP ══▶ client of `far` ─▶ pong     ours
//!  ping ─▶ relay            ═══ TCP ══▶ relay      ═══ TCP ══▶ relay           ─▶ pong     `relays`: the least cost
//! ```
//! All over the loopback device. Everything that is timed runs at `SCHED_FIFO` 50; disturbing programs run as any other
//! process.

pub mod crowd;
mod door;
pub mod guest;
pub mod hostile;
mod pace;
pub mod relays;
mod stalled;
pub mod systems;
pub mod tally;
pub mod zenoh;
