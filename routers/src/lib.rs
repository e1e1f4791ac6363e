//! Carries packages between the nodes of a system, and keeps one time for all of them (seed 002, 2.2.3, 3.2 and 4).
//!
//! ```text
//!  modules ──▶ mailbox of the router ──▶ Outbound: 32 levels, quotas, pacing ══ UDP ══▶ Inbound: gaps, copies, reassembly ──▶ mailboxes
//!                                          │ undeliverable: an error back to its sender                │ no such mailbox, full: the same
//!  Clock ◀══ synchronisation, calibration ══▶ Clock of the master                        writes the node's page of system time
//! ```
//!
//! In time slots (`tdma`) a node sends all of this in its own windows only.
//!
//! All protocol logic is without sockets, threads and clocks: time comes as an argument, datagrams as bytes. The same code runs under
//! real sockets (`shell`) and in a simulation of whole networks (`tests/testbed`), with time slots up to the thread's own loop
//! (`driver`).

#![forbid(unsafe_code)]

pub mod admission;
pub mod broken;
pub mod counts;
pub mod driver;
pub mod flows;
pub mod fragment;
pub mod frame;
#[cfg(test)]
mod harness;
pub mod impair;
pub mod inbound;
pub mod intake;
pub mod lab;
pub mod latencies;
pub mod link;
mod netlink;
pub mod outbound;
pub mod queue;
pub mod report;
pub mod security;
pub mod session;
pub mod settings;
pub mod shell;
pub mod stats;
pub mod tcp;
pub mod tdma;
pub mod time;
