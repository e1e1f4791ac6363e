//! Carries packages beyond the LAN: the TCP router, and each node's client of it.

pub(crate) mod client;
pub(crate) mod ends;
pub(crate) mod server;
