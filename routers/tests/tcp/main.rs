//! The TCP router and its clients with real sockets.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod ground;
mod sealed;
mod sessions;
