//! Carries packages between the nodes of a system, and keeps one time for all of them (seed 002, 2.2.3, 3.2 and 4).
//!
//! ```text
//!  modules ─▶ transit mailbox ─▶ Outbound: levels, quotas, pace ═ UDP ═▶ Inbound: gaps, duplicates, order ─▶ mailbox
//!                                  │ undeliverable: an error to its sender   │ no such mailbox, full: the same
//!  Clock ◀═ synchronisation, calibration ═▶ Clock of the master      writes the node's page of system time
//! ```
//!
//! In time slots (`tdma`) a node sends all of this in its own windows only.
//!
//! Cores have no socket, thread or clock: time comes as an argument, datagrams as bytes. The same code runs with real
//! sockets (`shell`, `tcp`) and in a simulation of whole networks (`tests/testbed`), up to what the threads decide
//! (`driver`).
//!
//! # Reading order
//!
//! 1. `frame`: a datagram, checked once. `outbound`, `queue`, `fragment`: what leaves, and when. `inbound`,
//!    `admission`: what may enter. `security`: seals, challenge and response, before `inbound`.
//! 2. `time`: master, follower, election. `tdma`: the scheduler of time slots.
//! 3. `session`, `tcp`: clients and server beyond the LAN. `shell`: threads and sockets of the LAN.
//!    `team`: other systems without a server.
//! 4. `driver`: what the threads that send, receive and keep time do, over clock, mailbox and wire.
//! 5. `replication`: streams of one node on others.
//! 6. `stats`, `flows`, `report`: what is counted and reported. `impair`, `lab`: a bad network, nodes in namespaces.
//!
//! # Invariants
//!
//! All memory is bounded: queue, fragments, tables of peers. What is real time and what is not have threads, queues and
//! ports of their own, and neither waits for the other.

#![forbid(unsafe_code)]

pub mod admission;
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
pub mod moving;
mod netlink;
pub mod outbound;
mod port;
pub mod queue;
pub mod replication;
pub mod report;
pub mod security;
pub mod session;
pub mod settings;
pub mod shell;
pub mod stats;
pub mod tcp;
pub mod tdma;
pub mod team;
pub mod time;
