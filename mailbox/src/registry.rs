//! Making, adopting, replacing and removing mailboxes (`inspect` looks at them): the files of a node's directory are
//! the registry.
//!
//! All changes happen under the node's registry lock, and a mailbox is only changed by the holder of its owner's lock.
//! A file gets its name last, whole; so nobody ever opens half a mailbox.

use crate::counters::Loss;
use crate::files::{allocate, is_lack_of_descriptors, is_lack_of_memory, open_shared};
use crate::layout::{Shape, ShapeError};
use crate::lock::Held;
use crate::memory::Use;
use crate::name::Name;
use crate::node::{Node, NodeError, REGISTRY_PATIENCE, RegistryLock};
use crate::participant::Participant;
use crate::queue::Queue;
use crate::receiver::Receiver;
use crate::segment::{BadSegment, Segment, path_of};
use crate::step::step;
use crate::unlink::unlink;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The byte of a segment's file that its owner locks.
pub(crate) const OWNER_BYTE: u64 = 0;

/// Why a mailbox could not be made.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// Reserved parts.
    #[error("mailbox {0}: system and class 0 and system 255 are reserved")]
    Reserved(Name),
    /// Impossible shape.
    #[error("mailbox {0}: {1}")]
    Shape(Name, ShapeError),
    /// Somebody receives there.
    #[error(
        "mailbox {0} is owned by process {1}; one mailbox has one receiver: stop that process, or use another instance"
    )]
    Owned(Name, u32),
    /// The node cannot be used.
    #[error(transparent)]
    Node(NodeError),
    /// No memory, most likely.
    #[error(
        "mailbox {name}: {bytes} bytes of shared memory: {source}; is it full (df {})?",
        crate::files::existing(.node).display()
    )]
    Memory {
        /// Which mailbox.
        name: Name,
        /// How much it needs.
        bytes: usize,
        /// The node's directory.
        node: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// As many files are open as may be.
    #[error(
        "mailbox {0}: this process, or the computer, has no file descriptor left, and each mailbox that a process \
         receives \
         from takes one; raise the limit (ulimit -n, or LimitNOFILE= of a service), or use several processes"
    )]
    Descriptors(Name),
    /// Its file cannot be used.
    #[error("mailbox {0}: its file {1}: {2}")]
    File(Name, PathBuf, io::Error),
}

impl CreateError {
    /// What the system said of a mailbox's file, which lies in the node's directory.
    fn of(file: &Path, name: Name, shape: &Shape, source: io::Error) -> Self {
        if is_lack_of_memory(&source) {
            let node = file.parent().unwrap_or(file).into();
            return Self::Memory { name, bytes: shape.segment_bytes(), node, source };
        }
        if is_lack_of_descriptors(&source) {
            return Self::Descriptors(name);
        }
        Self::File(name, file.into(), source)
    }

    fn of_node(name: Name, error: NodeError) -> Self {
        if matches!(error, NodeError::Descriptors(_)) { Self::Descriptors(name) } else { Self::Node(error) }
    }
}

impl Participant {
    /// Makes this participant the receiver of a mailbox. What an earlier receiver left there is adopted if the shape is
    /// the same; else the old mailbox is given up and replaced.
    ///
    /// # Errors
    /// See [`CreateError`].
    pub fn receiver(self: &Arc<Self>, name: Name, shape: Shape) -> Result<Receiver, CreateError> {
        if !name.is_mailbox() {
            return Err(CreateError::Reserved(name));
        }
        shape.check().map_err(|error| CreateError::Shape(name, error))?;
        let shape = shape.as_stored();
        let taken = RegistryLock::take(self.node().path());
        let _registry = taken.map_err(|error| CreateError::of_node(name, error))?;
        let (segment, lock) = match self.take_over(name, shape)? {
            Predecessor::Same(segment, lock) => (segment, lock),
            Predecessor::Other(old) => self.make(name, shape, Some(&old))?,
            Predecessor::None => self.make(name, shape, None)?,
        };
        // Also of one that is taken over: its maker may have died before it could.
        self.node().raise_registry_epoch();
        step!("create: owned");
        let owner = &segment.page().owner;
        owner.pid.store(std::process::id(), Ordering::Relaxed);
        // ORDERING: Release; a sender that sees `sleeping` set by this owner sees which bell to ring.
        owner.participant.store(u32::from(self.claimant().participant), Ordering::Release);
        Ok(Receiver::new(self.clone(), segment, lock))
    }

    /// Looks at what is there, as its owner, and adopts it if it is the same.
    fn take_over(&self, name: Name, shape: Shape) -> Result<Predecessor, CreateError> {
        let path = path_of(self.node().path(), name);
        let failed = |source| CreateError::of(&path, name, &shape, source);
        let file = match open_shared(&path, false) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Predecessor::None),
            Err(error) => return Err(failed(error)),
        };
        let old = match Segment::check(&file, name, Use::Keep) {
            Ok(old) => Some(old),
            Err(BadSegment::Foreign | BadSegment::Version(_)) => None,
            Err(BadSegment::Io(error)) => return Err(failed(error)),
        };
        let Some(lock) = Held::try_take(file, OWNER_BYTE).map_err(failed)? else {
            let pid = old.map_or(0, |old| old.page().owner.pid.load(Ordering::Relaxed));
            return Err(CreateError::Owned(name, pid));
        };
        let Some(old) = old else { return Ok(Predecessor::None) };
        if old.shape != shape || old.slots().is_retired() {
            return Ok(Predecessor::Other(old));
        }
        step!("adopt: before");
        let page = old.page();
        old.slots().adopt(|priority| page.counters.lost(priority, Loss::Poison, 1));
        page.owner.adoptions.fetch_add(1, Ordering::Relaxed);
        Ok(Predecessor::Same(old, lock))
    }

    /// Makes the file, whole, then gives it its name. The old mailbox is given up only when the new one is whole:
    /// without memory for that, what the old one holds stays.
    fn make(&self, name: Name, shape: Shape, old: Option<&Segment>) -> Result<(Segment, Held), CreateError> {
        let node = self.node();
        let path = path_of(node.path(), name);
        // One maker at a time (the registry's lock), so one temporary name will do; a dead maker's leftover is
        // overwritten.
        let unfinished = node.path().join("unfinished");
        let made = || {
            let _ = fs::remove_file(&unfinished);
            let file = open_shared(&unfinished, true)?;
            step!("create: file");
            allocate(&file, shape.segment_bytes())?;
            step!("create: allocated");
            let segment = Segment::format(&file, name, shape)?;
            let lock = Held::try_take(file, OWNER_BYTE)?.ok_or(io::ErrorKind::WouldBlock)?;
            step!("create: formatted");
            if let Some(old) = old {
                retire(old);
                let counters = &segment.page().counters;
                counters.carry_over(&old.page().counters);
                // Not the old one's tickets: those of packages that their senders took back were never accepted.
                segment.page().hot.ticket.0.store(counters.accepted(), Ordering::Relaxed);
                step!("create: carried over");
            }
            fs::rename(&unfinished, &path)?;
            step!("create: named");
            Ok((segment, lock))
        };
        made().map_err(|source| {
            let _ = fs::remove_file(&unfinished);
            CreateError::of(&unfinished, name, &shape, source)
        })
    }
}

/// What stood under a name before.
enum Predecessor {
    None,
    /// A mailbox of the same shape is adopted.
    Same(Segment, Held),
    /// To be given up; its counters go on in the next.
    Other(Segment),
}

/// Gives a mailbox without owner up, and counts what it still held.
fn retire(old: &Segment) {
    let slots = old.slots();
    slots.retire();
    step!("retire: retired");
    slots.adopt(|priority| old.page().counters.lost(priority, Loss::Poison, 1));
    let mut queue = Queue::new(slots.count());
    queue.rescan(&slots);
    while let Some(taken) = queue.take(&slots) {
        old.page().counters.lost(taken.word().priority(), Loss::Closed, 1);
        slots.release(taken);
    }
    slots.settle(|victim| old.page().counters.gave_way(victim));
}

impl Node {
    /// Removes a mailbox that nobody owns; false when somebody does, or it is gone.
    ///
    /// # Errors
    /// When the node's directory cannot be changed.
    pub fn remove_orphan(&self, name: Name) -> Result<bool, NodeError> {
        self.remove_orphan_within(name, REGISTRY_PATIENCE)
    }

    /// The same for a caller that must not wait: [`NodeError::Busy`] at once while somebody else changes the registry.
    ///
    /// # Errors
    /// When the registry is busy, or the node's directory cannot be changed.
    pub fn try_remove_orphan(&self, name: Name) -> Result<bool, NodeError> {
        self.remove_orphan_within(name, Duration::ZERO)
    }

    fn remove_orphan_within(&self, name: Name, patience: Duration) -> Result<bool, NodeError> {
        let path = path_of(self.path(), name);
        let failed = |error| NodeError::Io(path.clone(), error);
        let registry = RegistryLock::take_within(self.path(), patience)?;
        let Ok(file) = open_shared(&path, false) else { return Ok(false) };
        let old = Segment::check(&file, name, Use::Share);
        let Some(_owner) = Held::try_take(file, OWNER_BYTE).map_err(failed)? else { return Ok(false) };
        if let Ok(old) = old {
            retire(&old);
        }
        unlink(self, name, &registry)?;
        Ok(true)
    }

    /// Removes the whole directory if nothing lives in it: no launch, no participant. Mailboxes without owner go first.
    ///
    /// # Errors
    /// When something cannot be removed.
    pub fn remove_if_dead(&self) -> Result<bool, NodeError> {
        let Some(_nobody) = self.keep_all_out()? else { return Ok(false) };
        for name in self.mailboxes()? {
            self.remove_orphan(name)?;
        }
        let failed = |error| NodeError::Io(self.path().into(), error);
        fs::remove_dir_all(self.path()).map_err(failed)?;
        Ok(true)
    }
}
