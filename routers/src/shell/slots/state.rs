//! What the thread of the time slots lets others see.

use super::granted::Granted;
use crate::tdma::{Counts, Silent, Window};
use std::sync::{Mutex, PoisonError};

/// So many windows are remembered.
pub const WINDOWS: usize = 16;

/// A window that was used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Used {
    /// Which, in system time.
    pub window: Window,
    /// The first datagram was on the wire so long after the beginning, ns: by the kernel's stamp where there is one, else when it was
    /// handed over and the usual lead. Less than 0: too early.
    pub off_ns: i64,
    /// Whether it was the kernel's stamp.
    pub by_kernel: bool,
    /// Datagrams.
    pub datagrams: u64,
    /// Their bytes on the wire, all heads counted.
    pub wire_bytes: u64,
}

/// How it stands with the time slots of this node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Snapshot {
    /// What became of its windows.
    pub counts: Counts,
    /// Why it does not send; none if it does.
    pub silent: Option<Silent>,
    /// From the call to the wire, ns: the median, and by how much calls are made earlier.
    pub lead_ns: (u64, u64),
    /// How the thread is scheduled.
    pub granted: Granted,
    /// Datagrams that waited for the next slot, since the thread stood still between their making and their leaving.
    pub held: u64,
    /// The last windows that were used, the oldest first, as far as there were so many.
    pub windows: [Option<Used>; WINDOWS],
}

impl Snapshot {
    pub(super) fn used(&mut self, used: Used) {
        self.windows.rotate_left(1);
        self.windows[WINDOWS - 1] = Some(used);
    }
}

/// Shared by the thread of the time slots and whoever wants to know.
#[derive(Debug)]
pub struct State {
    snapshot: Mutex<Snapshot>,
}

impl State {
    pub(super) fn new(snapshot: Snapshot) -> Self {
        Self { snapshot: Mutex::new(snapshot) }
    }

    /// How it stands.
    pub fn snapshot(&self) -> Snapshot {
        *self.snapshot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of the thread itself. It never waits for who looks: then the next one is shown.
    pub(super) fn show(&self, snapshot: &Snapshot) {
        if let Ok(mut shown) = self.snapshot.try_lock() {
            *shown = *snapshot;
        }
    }
}
