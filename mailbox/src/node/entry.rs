//! One participant's line in its node's table.

use crate::name::Name;
use crate::node::work::{InHand, Mark};
use crate::wake::bell::Bell;
use std::mem::offset_of;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Most participants of a node at a time.
pub const PARTICIPANTS_MAX: usize = 256;

/// What a module is doing, as its node's table says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u32)]
pub enum ModuleState {
    /// Not ready for commands yet.
    Starting = 1,
    /// Ready, and switched off.
    Off = 2,
    /// Working.
    On = 3,
    /// It has stopped working and says why in its status.
    Error = 4,
    /// About to end.
    Stopping = 5,
    /// Ready but for its mailboxes: another node runs it, and this one may be next.
    StandsBy = 6,
}

impl ModuleState {
    /// One word for tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::Off => "off",
            Self::On => "on",
            Self::Error => "error",
            Self::Stopping => "stopping",
            Self::StandsBy => "stands by",
        }
    }

    /// From the state of a line, which may complain besides.
    fn from_code(code: u32) -> Option<Self> {
        let code = code & !COMPLAINS;
        let all = [Self::Starting, Self::Off, Self::On, Self::Error, Self::Stopping, Self::StandsBy];
        all.into_iter().find(|s| *s as u32 == code)
    }
}

/// With its state a module says that something does not work although it is on.
pub(crate) const COMPLAINS: u32 = 1 << 8;

/// One participant's line.
#[repr(C, align(64))]
pub(crate) struct Entry {
    /// Incarnation of its present or last user; 0: never used.
    pub(crate) incarnation: AtomicU32,
    pub(crate) pid: AtomicU32,
    /// The futex word it sleeps on.
    pub(crate) bell: AtomicU32,
    pub(crate) module: AtomicU32,
    pub(crate) state: AtomicU32,
    /// Times that launch has started this module again.
    pub(crate) restarts: AtomicU32,
    pub(crate) joined_ns: AtomicU64,
    /// Not 0: it sleeps in `poll`; ring it through its pipe too.
    pub(crate) polling: AtomicU32,
    /// Times that the module went into error, or began another complaint.
    pub(crate) errors: AtomicU32,
    /// What its thread has in hand. Senders touch this line only to wake it, which they do when it has nothing.
    pub(crate) mark: Mark,
}
const _: () = assert!(size_of::<Entry>() == 64 && offset_of!(Entry, joined_ns) == 24);
const _: () = assert!(offset_of!(Entry, errors) == 36 && offset_of!(Entry, mark) == 40);

/// One participant, as the table has it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParticipantInfo {
    /// The module it is, local id 0; [`Name::NONE`] for one without a name.
    pub module: Name,
    /// Its process.
    pub pid: u32,
    /// Tells this use of the name from earlier ones.
    pub incarnation: u32,
    /// What the module is doing; none for participants that are no modules.
    pub state: Option<ModuleState>,
    /// Whether something does not work although it is on; [what], it says itself when it is asked.
    ///
    /// [what]: crate::Participant::set_complaint
    pub complains: bool,
    /// Times that it went into error or began another complaint: tells one from the next, however short the time
    /// between them.
    pub errors: u32,
    /// Times that launch has started it again.
    pub restarts: u32,
    /// When it joined, on the monotonic clock.
    pub joined_ns: u64,
    /// What it has in hand, while it is in the module's own code.
    pub in_hand: Option<InHand>,
}

impl ParticipantInfo {
    /// Whether it joined after the node gave out this incarnation.
    pub fn joined_after(&self, incarnation: u32) -> bool {
        // They wrap.
        self.incarnation.wrapping_sub(incarnation).cast_signed() > 0
    }
}

impl Entry {
    pub(crate) fn bell(&self) -> Bell<'_> {
        Bell { rings: &self.bell, polling: &self.polling }
    }

    pub(crate) fn read(&self) -> ParticipantInfo {
        let module = Name::from_raw(self.module.load(Ordering::Acquire));
        let state = self.state.load(Ordering::Acquire);
        ParticipantInfo {
            module,
            pid: self.pid.load(Ordering::Relaxed),
            incarnation: self.incarnation.load(Ordering::Relaxed),
            state: ModuleState::from_code(state),
            complains: state & COMPLAINS != 0,
            // Behind the state, which is stored behind it.
            errors: self.errors.load(Ordering::Relaxed),
            restarts: self.restarts.load(Ordering::Relaxed),
            joined_ns: self.joined_ns.load(Ordering::Relaxed),
            in_hand: self.mark.read(),
        }
    }
}
