//! The router at work: threads, sockets, mailboxes.

pub mod clock;
mod failure;
mod socket;
mod ways;

pub use failure::{Failure, Failures};
pub use socket::SocketError;
