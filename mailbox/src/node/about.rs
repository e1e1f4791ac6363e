//! What a mailbox is for, in words of its owner: a file beside it that anyone may read without asking the owner.
//!
//! This crate does not know what it says. It appears whole, stays as long as the mailbox, and goes before it.

use crate::name::Name;
use crate::node::beside::unfinished;
use crate::node::directory::Node;
use crate::node::error::NodeError;

fn file_name(name: Name) -> String {
    format!("{:08x}.about", name.raw())
}

/// Lays these words beside a mailbox, in place of what an earlier owner said; the caller owns it.
pub(crate) fn set(node: &Node, name: Name, words: &[u8]) -> Result<(), NodeError> {
    node.put_file(&file_name(name), words)
}

impl Node {
    /// What the owner of a mailbox said of it, if it said something. An owner that has just begun may say something
    /// else than the one before it; another process wrote it, so check it.
    pub fn about(&self, name: Name) -> Option<Vec<u8>> {
        self.read_file(&file_name(name)).ok()?
    }
}

/// The mailbox goes: its words first, so that none are left without it.
pub(crate) fn remove(node: &Node, name: Name) {
    let about = file_name(name);
    for file in [&unfinished(&about), &about] {
        let _ = node.directory().remove(file);
    }
}
