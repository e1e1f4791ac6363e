//! What a mailbox is for, in words of its owner: a file beside it that anyone may read without asking the owner.
//!
//! This crate does not know what it says. It appears whole, stays as long as the mailbox, and goes before it.

use crate::files::{open_shared, open_to_read};
use crate::name::Name;
use crate::node::{Node, NodeError};
use crate::step::step;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// What is longer is nobody's description.
const ABOUT_BYTES_MAX: u64 = 1 << 20;

fn path_of(node: &Path, name: Name) -> PathBuf {
    node.join(format!("{:08x}.about", name.raw()))
}

fn unfinished(node: &Path, name: Name) -> PathBuf {
    node.join(format!("{:08x}.about.new", name.raw()))
}

/// Lays these words beside a mailbox, in place of what an earlier owner said; the caller owns it.
pub(crate) fn set(node: &Node, name: Name, words: &[u8]) -> Result<(), NodeError> {
    let (path, unfinished) = (path_of(node.path(), name), unfinished(node.path(), name));
    let write = || {
        let _ = fs::remove_file(&unfinished);
        open_shared(&unfinished, true)?.write_all(words)?;
        step!("about: written");
        fs::rename(&unfinished, &path)
    };
    write().map_err(|error: io::Error| {
        let _ = fs::remove_file(&unfinished);
        NodeError::of(&path, error)
    })
}

impl Node {
    /// What the owner of a mailbox said of it, if it said something. An owner that has just begun may say something
    /// else than the one before it; another process wrote it, so check it.
    pub fn about(&self, name: Name) -> Option<Vec<u8>> {
        let mut words = Vec::new();
        let file = open_to_read(&path_of(self.path(), name)).ok()?;
        file.take(ABOUT_BYTES_MAX + 1).read_to_end(&mut words).ok()?;
        (words.len() as u64 <= ABOUT_BYTES_MAX).then_some(words)
    }
}

/// The mailbox goes: its words first, so that none are left without it.
pub(crate) fn remove(node: &Node, name: Name) {
    for path in [unfinished(node.path(), name), path_of(node.path(), name)] {
        let _ = fs::remove_file(path);
    }
}
