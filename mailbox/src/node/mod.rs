//! A node: live participants, and the names of their mailboxes.
//!
//! `directory` is the node, `entry` one line of its table, `participant` holds it, `process` and `lock` tell whether
//! that lives, `work` what it has in hand. `registry` and `unlink`: mailboxes by name; `routes`: those on other nodes;
//! `beside` and `about`: what lies beside them.

pub(crate) mod about;
pub(crate) mod beside;
pub(crate) mod directory;
pub(crate) mod entry;
pub(crate) mod error;
pub(crate) mod lock;
pub(crate) mod participant;
pub(crate) mod process;
pub(crate) mod registry;
pub(crate) mod routes;
pub(crate) mod unlink;
pub(crate) mod work;
