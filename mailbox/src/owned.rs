//! Files of a node's directory that one participant owns, mailboxes and streams: making, taking over, replacing and
//! removing them.
//!
//! All changes happen under the node's registry lock, and a file is only changed by the holder of its owner's lock. A
//! file gets its name last, whole; so nobody ever opens half of one.

use crate::files::{allocate, open_shared};
use crate::layout::VERSION;
use crate::lock::Held;
use crate::memory::Use;
use crate::node::{Node, NodeError, RegistryLock};
use crate::step::step;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The byte of a file that its owner locks.
pub(crate) const OWNER_BYTE: u64 = 0;

/// Why a file is not what it should be.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadFile {
    /// Foreign, or damaged; what it should be.
    #[error("its file is no {0}, or damaged; end its owner, and remove the file with `rohrpost clean`")]
    Foreign(&'static str),
    /// Another version's layout.
    #[error("it was made by another version (layout {0}, this program {VERSION}); build both from the same version")]
    Version(u32),
    /// Shorter than what it says that it is.
    #[error(
        "its file was cut: it has {there} bytes, and says that it is a {what} of {whole}; end its owner, and remove \
         the file with `rohrpost clean`"
    )]
    Cut {
        /// What it should be.
        what: &'static str,
        /// Bytes of the file.
        there: u64,
        /// Bytes that it should have.
        whole: u64,
    },
    /// Whole, and of another name.
    #[error("its file is that of {0}: somebody copied or renamed it; remove it with `rohrpost clean`")]
    Misnamed(String),
}

/// Why a file cannot be used as what it should be.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BadSegment {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    File(#[from] BadFile),
}

/// A kind of file that one participant owns.
pub(crate) trait Owned: Sized {
    /// The word for it.
    const WHAT: &'static str;
    /// What it is found by.
    type Id: Copy;
    /// What it is made as.
    type Shape: Copy;

    /// Its file.
    fn path(node: &Path, id: Self::Id) -> PathBuf;
    /// How long the file is.
    fn bytes(shape: &Self::Shape) -> usize;
    /// Maps a file and checks that it is this, whole.
    fn check(file: &File, id: Self::Id, used: Use) -> Result<Self, BadSegment>;
    /// Maps a file that was just made, and writes what it is. The old one is to be replaced by it.
    fn format(file: &File, id: Self::Id, shape: Self::Shape, old: Option<&Self>) -> io::Result<Self>;
    /// Whether a new owner that wants this shape takes it over as it is.
    fn goes_on_as(&self, shape: &Self::Shape) -> bool;
    /// Takes over what a dead owner left, as what it goes on as.
    fn adopt(&self, shape: &Self::Shape);
    /// Gives the old one up, and goes on with its counts.
    fn replace(&self, old: &Self);
    /// Gives it up.
    fn retire(&self);
}

/// Why it could not be had.
pub(crate) enum Refused<S> {
    /// Somebody has it; what is there, or why it cannot be read.
    Owned(Result<S, BadFile>),
    File(PathBuf, io::Error),
}

/// What stood there before.
enum Predecessor<S> {
    None,
    /// One of the same shape is adopted.
    Same(S, Held),
    /// To be given up; its counts go on in the next.
    Other(S),
}

/// Makes the caller the owner of what has this id. What is there is taken over if the shape is the same; else it is
/// given up and replaced.
pub(crate) fn obtain<S: Owned>(
    node: &Node,
    id: S::Id,
    shape: S::Shape,
    _registry: &RegistryLock,
) -> Result<(S, Held), Refused<S>> {
    let path = S::path(node.path(), id);
    match take_over(&path, id, &shape)? {
        Predecessor::Same(segment, lock) => Ok((segment, lock)),
        Predecessor::Other(old) => make(node, &path, id, shape, Some(&old)),
        Predecessor::None => make(node, &path, id, shape, None),
    }
}

/// Looks at what is there, as its owner, and adopts it if it is the same.
fn take_over<S: Owned>(path: &Path, id: S::Id, shape: &S::Shape) -> Result<Predecessor<S>, Refused<S>> {
    let failed = |source| Refused::File(path.into(), source);
    let file = match open_shared(path, false) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Predecessor::None),
        Err(error) => return Err(failed(error)),
    };
    let old = match S::check(&file, id, Use::Keep) {
        Ok(old) => Ok(old),
        Err(BadSegment::File(why)) => Err(why),
        Err(BadSegment::Io(error)) => return Err(failed(error)),
    };
    let Some(lock) = Held::try_take(file, OWNER_BYTE).map_err(failed)? else { return Err(Refused::Owned(old)) };
    let Ok(old) = old else { return Ok(Predecessor::None) };
    if !old.goes_on_as(shape) {
        return Ok(Predecessor::Other(old));
    }
    step!("adopt: before");
    old.adopt(shape);
    Ok(Predecessor::Same(old, lock))
}

/// Makes the file, whole, then gives it its name. The old one is given up only when the new one is whole: without
/// memory for that, what the old one holds stays.
fn make<S: Owned>(
    node: &Node,
    path: &Path,
    id: S::Id,
    shape: S::Shape,
    old: Option<&S>,
) -> Result<(S, Held), Refused<S>> {
    // One maker at a time (the registry's lock), so one temporary name will do; a dead maker's leftover is overwritten.
    let unfinished = node.path().join("unfinished");
    let made = || {
        let _ = fs::remove_file(&unfinished);
        let file = open_shared(&unfinished, true)?;
        step!("create: file");
        allocate(&file, S::bytes(&shape))?;
        step!("create: allocated");
        let segment = S::format(&file, id, shape, old)?;
        let lock = Held::try_take(file, OWNER_BYTE)?.ok_or(io::ErrorKind::WouldBlock)?;
        step!("create: formatted");
        if let Some(old) = old {
            segment.replace(old);
            step!("create: carried over");
        }
        fs::rename(&unfinished, path)?;
        step!("create: named");
        Ok((segment, lock))
    };
    made().map_err(|source| {
        let _ = fs::remove_file(&unfinished);
        Refused::File(unfinished, source)
    })
}

/// Removes one that nobody owns, by `unlink`; false when somebody does, or it is gone.
pub(crate) fn remove_orphan<S: Owned>(
    node: &Node,
    id: S::Id,
    unlink: impl FnOnce() -> Result<(), NodeError>,
) -> Result<bool, NodeError> {
    let path = S::path(node.path(), id);
    let Ok(file) = open_shared(&path, false) else { return Ok(false) };
    let old = S::check(&file, id, Use::Share);
    let held = Held::try_take(file, OWNER_BYTE).map_err(|error| NodeError::Io(path, error))?;
    let Some(_owner) = held else { return Ok(false) };
    if let Ok(old) = old {
        old.retire();
    }
    unlink()?;
    Ok(true)
}
