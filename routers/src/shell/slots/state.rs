//! What the thread of the time slots lets others see.

use super::scheduling::ActualScheduling;
use crate::driver::WindowLog;
use crate::tdma::{Silent, SlotCounts};
use std::sync::{Mutex, PoisonError};

/// Time slots of this node at one moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SlotSnapshot {
    /// What became of its windows.
    pub counts: SlotCounts,
    /// Why it does not send; none if it does.
    pub silent: Option<Silent>,
    /// From the call to the wire, ns: the median, and by how much calls are made earlier.
    pub lead_ns: (u64, u64),
    /// How the thread is scheduled.
    pub granted: ActualScheduling,
    /// The last windows, and what missed its own.
    pub log: WindowLog,
}

/// Shared by the thread of the time slots and its readers.
#[derive(Debug)]
pub struct SlotStatus {
    snapshot: Mutex<SlotSnapshot>,
}

impl SlotStatus {
    pub(super) fn new(snapshot: SlotSnapshot) -> Self {
        Self { snapshot: Mutex::new(snapshot) }
    }

    /// The present state.
    pub fn snapshot(&self) -> SlotSnapshot {
        *self.snapshot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// For the thread itself. It never waits for a reader: then the next snapshot is shown.
    pub(super) fn show(&self, snapshot: &SlotSnapshot) {
        if let Ok(mut shown) = self.snapshot.try_lock() {
            *shown = *snapshot;
        }
    }
}
