//! The TCP router and its clients with real sockets.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod beside;
mod foreign_eyes;
mod ground;
mod hostile;
#[allow(dead_code, reason = "each test uses a part")]
#[path = "../shell_common/mod.rs"]
mod lan;
mod network;
mod sealed;
mod sessions;
mod versions;
