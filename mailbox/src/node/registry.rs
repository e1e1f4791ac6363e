//! Making, adopting, replacing and removing mailboxes (`inspect` looks at them): the files of a node's directory are
//! the registry. `owned` has what mailboxes and streams have in common.

use crate::figures::counters::Loss;
use crate::memory::files::{is_lack_of_descriptors, is_lack_of_memory};
use crate::memory::layout::{Shape, ShapeError};
use crate::memory::mapping::Use;
use crate::memory::owned::{self, BadSegment, Owned, Refused};
use crate::memory::segment::{Segment, WHAT, file_name};
use crate::name::Name;
use crate::node::directory::{Node, RegistryLock};
use crate::node::error::{NodeError, REGISTRY_PATIENCE};
use crate::node::participant::Participant;
use crate::node::unlink::unlink;
use crate::receiver::Receiver;
use crate::slots::queue::Queue;
use crate::step::step;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

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
        crate::memory::files::existing(.node).display()
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
    File(Name, PathBuf, #[source] io::Error),
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
        let taken = RegistryLock::take(self.node().directory());
        let registry = taken.map_err(|error| CreateError::of_node(name, error))?;
        let mut hidden = self.hidden();
        let obtain = if hidden.is_some() { owned::obtain_hidden::<Segment> } else { owned::obtain::<Segment> };
        let (segment, lock) = obtain(self.node(), name, shape, &registry).map_err(|why| match why {
            Refused::Owned(there) => {
                CreateError::Owned(name, there.map_or(0, |there| there.page().owner.pid.load(Ordering::Relaxed)))
            }
            Refused::File(path, source) => CreateError::of(&path, name, &shape, source),
        })?;
        hidden.iter_mut().for_each(|hidden| hidden.push(name));
        // Also of one that is taken over: its maker may have died before it could.
        self.node().raise_registry_epoch();
        step!("create: owned");
        let owner = &segment.page().owner;
        owner.pid.store(std::process::id(), Ordering::Relaxed);
        // ORDERING: Release; a sender that sees `sleeping` set by this owner sees which bell to ring.
        owner.participant.store(u32::from(self.claimant().participant), Ordering::Release);
        Ok(Receiver::new(self.clone(), segment, lock))
    }

    /// From now on nobody finds the mailboxes that this participant makes: what is sent to their names goes where it
    /// would go without them. For a module that stands by while another node runs it.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Node, Participant, Shape};
    /// # let directory = tempfile::tempdir()?;
    /// let node = Node::create(&directory.path().join("node"), 0o700)?;
    /// let (pilot, sender) = (Name::new(1, 140, 0, 0), Participant::join(&node, Name::NONE)?);
    /// let module = Participant::join(&node, pilot)?;
    /// module.hide_mailboxes();
    /// let receiver = module.receiver(pilot, Shape::default())?;
    /// assert!(sender.sender(pilot).is_err());
    /// module.reveal_mailboxes()?;
    /// assert!(sender.sender(pilot).is_ok());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn hide_mailboxes(&self) {
        self.hidden().get_or_insert_default();
    }

    /// Gives all mailboxes that it hides their names, in which they are found from now on; what nobody owned there is
    /// given up.
    ///
    /// # Errors
    /// When somebody receives there, or the node's directory cannot be changed. Some may be found then.
    pub fn reveal_mailboxes(&self) -> Result<(), CreateError> {
        let node = self.node();
        let registry = RegistryLock::take(node.directory());
        let registry = registry.map_err(|error| CreateError::of_node(self.module(), error))?;
        for name in self.hidden().take().unwrap_or_default() {
            let file = file_name(name);
            let left = owned::remove_orphan::<Segment>(node, name, || unlink(node, name, &registry));
            if !left.map_err(|error| CreateError::of_node(name, error))? && node.directory().open_to_read(&file).is_ok()
            {
                let owner = node.look_at(name).and_then(|there| there.owner).unwrap_or(0);
                return Err(CreateError::Owned(name, owner));
            }
            let revealed = owned::reveal::<Segment>(node, name, &registry);
            revealed.map_err(|error| CreateError::File(name, node.path().join(file), error))?;
        }
        node.raise_registry_epoch();
        Ok(())
    }
}

impl Owned for Segment {
    const WHAT: &'static str = WHAT;
    type Id = Name;
    type Shape = Shape;

    fn file_name(name: Name) -> String {
        file_name(name)
    }

    fn bytes(shape: &Shape) -> usize {
        shape.segment_bytes()
    }

    fn check(file: &File, name: Name, used: Use) -> Result<Self, BadSegment> {
        Self::check(file, name, used)
    }

    fn format(file: &File, name: Name, shape: Shape, _old: Option<&Self>) -> io::Result<Self> {
        Self::format(file, name, shape)
    }

    fn goes_on_as(&self, shape: &Shape) -> bool {
        self.shape == *shape && !self.slots().is_retired()
    }

    fn adopt(&self, _: &Self::Shape) {
        let page = self.page();
        self.slots().adopt(|priority| page.counters.lost(priority, Loss::Poison, 1));
        page.owner.adoptions.fetch_add(1, Ordering::Relaxed);
    }

    fn replace(&self, old: &Self) {
        retire(old);
        let counters = &self.page().counters;
        counters.carry_over(&old.page().counters);
        // Not the old one's tickets: those of packages that their senders took back were never accepted.
        self.page().hot.ticket.0.store(counters.accepted(), Ordering::Relaxed);
    }

    fn retire(&self) {
        retire(self);
    }
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
        let registry = RegistryLock::take_within(self.directory(), patience)?;
        owned::remove_orphan::<Segment>(self, name, || unlink(self, name, &registry))
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
        self.directory().remove_all().map_err(failed)?;
        Ok(true)
    }
}
