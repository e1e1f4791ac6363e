//! Two nodes on a network of their own, and what can be compared there: ours, and what the kernel gives at best.
//!
//! ```text
//!  processor 0, namespace `near`                      processor 1, namespace `far`
//!  ping ─▶ mailbox ─▶ router ══╗                ╔══▶ router ─▶ mailbox ─▶ pong       ours
//!  ping ─▶ futex   ─▶ relay  ══╬══ veth, bridge ╬══▶ relay  ─▶ futex   ─▶ pong       `chain`: least cost of a router
//!  ping ═══════════════════════╝                ╚══════════════════════▶ pong       `udp`: the network alone
//! ```
//! Each drawn step is a process of its own; a node has two relays, like the two threads of a router.

pub mod chain;
pub mod ends;
pub mod flow;
pub mod junk;
pub mod load;
pub mod nodes;
pub mod records;
pub mod router;
pub mod rtnet;
pub mod sent;
pub mod skewed;
pub mod udp;
pub mod wire;

pub use wire::{Wire, prepare};
