//! Sleeping and waking: `bell` is the protocol, `doorbell` asks the kernel.
//!
//! `waiting` waits for mailboxes and streams, `watch` for file descriptors beside them.

pub(crate) mod bell;
pub(crate) mod doorbell;
pub(crate) mod waiting;
pub(crate) mod watch;
