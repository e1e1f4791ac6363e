//! Files of a node's directory that one participant owns, mailboxes and streams: making, taking over, replacing and
//! removing them.
//!
//! All changes happen under the node's registry lock, and a file is only changed by the holder of its owner's lock. A
//! file gets its name last, whole; so nobody ever opens half of one.

use crate::memory::files::{Unfit, allocate};
use crate::memory::layout::VERSION;
use crate::memory::mapping::Use;
use crate::node::directory::{Node, RegistryLock};
use crate::node::error::NodeError;
use crate::node::lock::Held;
use crate::step::step;
use std::fs::File;
use std::io;
use std::path::PathBuf;

/// The byte of a file that its owner locks.
pub(crate) const OWNER_BYTE: u64 = 0;

/// Why a file is not what it should be.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadFile {
    /// Foreign, or damaged; what it should be.
    #[error("its file is no {0}, or damaged; end its owner, and remove the file with `rohrpost clean`")]
    Foreign(&'static str),
    /// No file at all stands in its place: a link, say.
    #[error(
        "{kind} stands where the file of the {what} belongs; end what uses the node, and remove it: `rohrpost clean`"
    )]
    NoFile {
        /// What it should be.
        what: &'static str,
        /// What it is.
        kind: &'static str,
    },
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

impl BadSegment {
    /// What opening the file said; what it should be.
    pub(crate) fn of_open(what: &'static str, error: io::Error) -> Self {
        Unfit::kind(&error).map_or_else(|| error.into(), |kind| BadFile::NoFile { what, kind }.into())
    }
}

/// A kind of file that one participant owns.
pub(crate) trait Owned: Sized {
    /// The word for it.
    const WHAT: &'static str;
    /// What it is found by.
    type Id: Copy;
    /// What it is made as.
    type Shape: Copy;

    /// The name of its file.
    fn file_name(id: Self::Id) -> String;
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
    let name = S::file_name(id);
    match take_over(node, id, &shape)? {
        Predecessor::Same(segment, lock) => Ok((segment, lock)),
        Predecessor::Other(old) => make(node, id, shape, Some(&old), &name),
        Predecessor::None => make(node, id, shape, None, &name),
    }
}

/// Makes one that nobody finds until [`reveal`] gives it its name. What is there under that name stays.
pub(crate) fn obtain_hidden<S: Owned>(
    node: &Node,
    id: S::Id,
    shape: S::Shape,
    _registry: &RegistryLock,
) -> Result<(S, Held), Refused<S>> {
    make(node, id, shape, None, &hidden_name::<S>(id))
}

/// Gives one that is hidden its name, in place of what has it.
pub(crate) fn reveal<S: Owned>(node: &Node, id: S::Id, _registry: &RegistryLock) -> io::Result<()> {
    node.directory().rename(&hidden_name::<S>(id), &S::file_name(id))
}

fn hidden_name<S: Owned>(id: S::Id) -> String {
    format!("{}.hidden", S::file_name(id))
}

/// Looks at what is there, as its owner, and adopts it if it is the same.
fn take_over<S: Owned>(node: &Node, id: S::Id, shape: &S::Shape) -> Result<Predecessor<S>, Refused<S>> {
    let name = S::file_name(id);
    let failed = |source| Refused::File(node.path().join(&name), source);
    let file = match node.directory().open_file(&name) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Predecessor::None),
        // It gives way to what is made.
        Err(error) if Unfit::is_kind(&error) => return Ok(Predecessor::None),
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
    id: S::Id,
    shape: S::Shape,
    old: Option<&S>,
    name: &str,
) -> Result<(S, Held), Refused<S>> {
    // One maker at a time (the registry's lock), so one temporary name will do.
    const UNFINISHED: &str = "unfinished";
    let directory = node.directory();
    let made = || {
        let file = directory.make_anew(UNFINISHED)?;
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
        directory.rename(UNFINISHED, name)?;
        step!("create: named");
        Ok((segment, lock))
    };
    made().map_err(|source| {
        let _ = directory.remove(UNFINISHED);
        Refused::File(node.path().join(UNFINISHED), source)
    })
}

/// Removes one that nobody owns, by `unlink`; false when somebody does, or it is gone.
pub(crate) fn remove_orphan<S: Owned>(
    node: &Node,
    id: S::Id,
    unlink: impl FnOnce() -> Result<(), NodeError>,
) -> Result<bool, NodeError> {
    let name = S::file_name(id);
    let file = match node.directory().open_file(&name) {
        Ok(file) => file,
        // Nobody can own it.
        Err(error) if Unfit::is_kind(&error) => return unlink().map(|()| true),
        Err(_) => return Ok(false),
    };
    let old = S::check(&file, id, Use::Share);
    let held = Held::try_take(file, OWNER_BYTE).map_err(|error| NodeError::Io(node.path().join(name), error))?;
    let Some(_owner) = held else { return Ok(false) };
    if let Ok(old) = old {
        old.retire();
    }
    unlink()?;
    Ok(true)
}
