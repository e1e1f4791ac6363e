//! Files and their bytes: the only addresses, and the only place where files of a node are opened.
//!
//! `files` opens, `mapping` maps; `layout` says where things lie in the `segment` of a mailbox, which `mapped` keeps
//! for senders; `owned` is what files of mailboxes and streams have in common.

pub(crate) mod files;
pub(crate) mod layout;
pub(crate) mod mapped;
pub(crate) mod mapping;
pub(crate) mod owned;
pub(crate) mod segment;
