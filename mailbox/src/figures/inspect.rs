//! Mailboxes seen from outside: which there are, and what each says of itself. Looking changes nothing, asks nobody and
//! needs no lock; so what is seen is a moment, and its parts are of moments that lie a little apart.

use crate::figures::counters::ClassTraffic;
use crate::memory::layout::Shape;
use crate::memory::owned::{BadSegment, OWNER_BYTE};
use crate::memory::segment::{Segment, name_of};
use crate::name::{Name, Priority};
use crate::node::directory::Node;
use crate::node::error::NodeError;
use crate::node::lock;
use crate::slots::word::{Claimant, State, Victim, Word};
use std::fs::File;
use std::io;
use std::sync::atomic::Ordering;

/// A mailbox seen from outside.
#[derive(Clone, Debug, Default)]
pub struct MailboxInfo {
    /// Its name.
    pub name: Name,
    /// Its shape.
    pub shape: Shape,
    /// Process that receives, if one does now.
    pub owner: Option<u32>,
    /// Times a new owner took over.
    pub adoptions: u32,
    /// Packages that wait or are in hand now.
    pub depth: u32,
    /// Most that its receiver ever found waiting.
    pub depth_max: u32,
    /// Packages ever accepted; after a sender was killed in the act, one more.
    pub sent: u64,
    /// By class: received, lost, latency.
    pub classes: Vec<ClassTraffic>,
}

/// The same, and what can be seen of the receiver and of each slot.
#[derive(Clone, Debug)]
pub struct MailboxDetail {
    /// What all mailboxes are listed with.
    pub info: MailboxInfo,
    /// The receiver, or the last one; none when there never was one.
    pub receiver: Option<Party>,
    /// Given up: nobody sends there any more, and the next receiver replaces it.
    pub is_retired: bool,
    /// Each slot, in order.
    pub slots: Vec<SlotInfo>,
}

/// A slot, as its word says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotInfo {
    /// Nobody uses it.
    Free,
    /// A package is being written, and not accepted yet.
    Filling {
        /// Its sender.
        by: Party,
        /// The accepted package that lost this slot to it, if there was one.
        victim: Option<VictimInfo>,
    },
    /// An accepted package waits.
    Ready(WaitingPackage),
    /// The receiver has it in hand; or had, when it died.
    Taken(WaitingPackage),
}

/// A package that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaitingPackage {
    /// How urgent it is.
    pub priority: Priority,
    /// Its place in the order of publishing; of one priority the smallest goes first.
    pub ticket: u64,
    /// An earlier receiver died with it in hand.
    pub is_redelivered: bool,
}

/// A package that was accepted and then lost its slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VictimInfo {
    /// How urgent it was.
    pub priority: Priority,
    /// By a newer one of its own sender; else by a more important one.
    pub is_replaced: bool,
}

/// A participant that a mailbox speaks of, living or dead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Party {
    /// Its place in the node's table.
    pub participant: u16,
    /// Its process; none when another has the place by now.
    pub pid: Option<u32>,
    /// The module that it is; [`Name::NONE`] for one without a name, or when another has the place by now.
    pub module: Name,
    /// Whether it lives: of a receiver, whether it still owns the mailbox.
    pub is_alive: bool,
}

/// Why a mailbox could not be looked at.
#[derive(Debug, thiserror::Error)]
pub enum InspectError {
    /// There is none of this name.
    #[error("mailbox {0}: not on this node")]
    Missing(Name),
    /// Its file is not what it should be, or may not be read.
    #[error("mailbox {0}: {1}")]
    Bad(Name, String),
}

impl Node {
    /// Names of all mailboxes of this node, in order.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn mailboxes(&self) -> Result<Vec<Name>, NodeError> {
        let failed = |error| NodeError::of(self.path(), error);
        let files = self.directory().names().map_err(failed)?;
        let mut names: Vec<Name> = files.filter_map(|file| name_of(&file)).collect();
        names.sort_unstable();
        Ok(names)
    }

    /// A mailbox as it is now; none when it does not exist (any more), or cannot be read.
    pub fn look_at(&self, name: Name) -> Option<MailboxInfo> {
        let (segment, file) = Segment::look_at(self.directory(), name).ok()?;
        let slots = segment.slots();
        Some(info(&segment, &file, (0..slots.count()).map(|slot| slots.load(slot))))
    }

    /// The same with all that can be seen.
    ///
    /// # Errors
    /// When there is no such mailbox, or what is there is none.
    pub fn inspect(&self, name: Name) -> Result<MailboxDetail, InspectError> {
        let (segment, file) = match Segment::look_at(self.directory(), name) {
            Ok(seen) => seen,
            Err(BadSegment::Io(error)) if error.kind() == io::ErrorKind::NotFound => {
                return Err(InspectError::Missing(name));
            }
            Err(error) => return Err(InspectError::Bad(name, error.to_string())),
        };
        let slots = segment.slots();
        let words: Vec<Word> = (0..slots.count()).map(|slot| slots.load(slot)).collect();
        let info = info(&segment, &file, words.iter().copied());
        Ok(MailboxDetail {
            receiver: self.receiver_of(&segment, info.owner.is_some()),
            is_retired: slots.is_retired(),
            slots: words.into_iter().map(|word| self.slot(word)).collect(),
            info,
        })
    }

    fn slot(&self, word: Word) -> SlotInfo {
        let waiting = || WaitingPackage {
            priority: word.priority(),
            ticket: word.ticket(),
            is_redelivered: word.is_redelivered(),
        };
        match word.state() {
            State::Free => SlotInfo::Free,
            State::Filling { by, victim } => SlotInfo::Filling {
                by: self.filler(by),
                victim: victim.map(|Victim { priority, replaced }| VictimInfo { priority, is_replaced: replaced }),
            },
            State::Ready => SlotInfo::Ready(waiting()),
            State::Taken => SlotInfo::Taken(waiting()),
        }
    }

    fn filler(&self, by: Claimant) -> Party {
        let there = self.entry(by.participant).read();
        // A participant that left in order has taken its number out of the table.
        let same = there.incarnation == by.incarnation && there.pid != 0;
        let is_alive = !self.is_dead(by);
        let module = if same { there.module } else { Name::NONE };
        Party { participant: by.participant, pid: same.then_some(there.pid), module, is_alive }
    }

    fn receiver_of(&self, segment: &Segment, is_alive: bool) -> Option<Party> {
        let owner = &segment.page().owner;
        // ORDERING: Acquire; pairs with the owner's Release, so that the number is the one of this participant.
        let participant = owner.participant.load(Ordering::Acquire) as u16;
        let pid = owner.pid.load(Ordering::Relaxed);
        let there = self.entry(participant).read();
        let module = if there.pid == pid { there.module } else { Name::NONE };
        (pid != 0).then_some(Party { participant, pid: Some(pid), module, is_alive })
    }
}

/// What a mailbox says of itself, beside these words of its slots.
fn info(segment: &Segment, file: &File, words: impl Iterator<Item = Word>) -> MailboxInfo {
    let page = segment.page();
    let owned = lock::is_locked(file, OWNER_BYTE).unwrap_or(false);
    MailboxInfo {
        name: segment.name,
        shape: segment.shape,
        owner: owned.then(|| page.owner.pid.load(Ordering::Relaxed)),
        adoptions: page.owner.adoptions.load(Ordering::Relaxed),
        depth: words.filter(|word| matches!(word.state(), State::Ready | State::Taken)).count() as u32,
        depth_max: page.owner.depth_max.load(Ordering::Relaxed),
        sent: page.hot.ticket.0.load(Ordering::Relaxed),
        classes: page.counters.read(),
    }
}
