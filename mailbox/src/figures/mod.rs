//! What anyone may read of mailboxes and senders; reading changes nothing.
//!
//! `counters` of a mailbox, `traffic` of a sender, `flows` of all senders, `inspect` for all of a mailbox.

pub(crate) mod counters;
pub(crate) mod flows;
pub(crate) mod inspect;
pub(crate) mod traffic;
