//! What registering costs, and how much of it there may be.

use crate::session::LOOK_EVERY_NS;
use crate::session::frame::{RANGES_MAX, Range};
use crate::session::table::ENTRIES_MAX;

/// Interval between two registrations of one client that are looked at.
pub(super) const REGISTER_EVERY_NS: u64 = LOOK_EVERY_NS;
/// Ranges that registrations may bring and replace from one look to the next: a fifth of the thread's time.
pub(super) const WORK_MAX: usize = ENTRIES_MAX;
/// Part of [`WORK_MAX`] for one principal: others have their turn beside it.
pub(super) const WORK_SHARE: usize = WORK_MAX / 8;
/// Cost of a registration besides its ranges, in ranges.
pub(super) const WORK_OF_ONE: usize = 16;
/// Ranges that one principal may have in the table.
pub(super) const RANGES_SHARE: usize = ENTRIES_MAX / 8;
const _: () = assert!(2 * RANGES_MAX + WORK_OF_ONE <= WORK_SHARE, "each registration has its turn some time");
const _: () = assert!(RANGES_MAX <= RANGES_SHARE, "a client that is alone in its share has as many as it may say");

/// Work on registrations that is still allowed, and registrations that were never looked at.
#[derive(Debug)]
pub(super) struct Registering {
    /// Ranges that may still be gone through before the next look.
    pub(super) left: usize,
    /// The principal with the first turn in the next round.
    pub(super) first: u16,
    /// Registrations that a later one of the same client took the place of.
    pub(super) superseded: u64,
}

impl Default for Registering {
    fn default() -> Self {
        Self { left: WORK_MAX, first: 0, superseded: 0 }
    }
}

/// Registrations of one client.
#[derive(Debug, Default)]
pub(super) struct Registrations {
    /// The next one is not looked at before, ns.
    pub(super) next_ns: u64,
    pub(super) waiting: Option<PendingRegistration>,
    /// Ranges that it hosts.
    pub(super) ranges: usize,
}

/// A registration that is not looked at yet.
#[derive(Debug)]
pub(super) struct PendingRegistration {
    pub(super) number: u32,
    pub(super) ranges: Vec<Range>,
}

impl Registrations {
    pub(super) fn bytes(&self) -> usize {
        self.waiting.as_ref().map_or(0, |waiting| waiting.ranges.capacity() * size_of::<Range>())
    }
}
