//! Commands that measure: rates, bytes, delays, answers, mailboxes and streams.

pub(crate) mod bw;
pub(crate) mod data;
pub(crate) mod delay;
pub(crate) mod graph;
pub(crate) mod hz;
pub(crate) mod mailbox;
pub(crate) mod ping;
pub(crate) mod send;
pub(crate) mod stream;
pub(crate) mod watch;
