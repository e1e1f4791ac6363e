//! What a clock's thread lets others see.

use crate::frame::NodeIndex;
use crate::replication::MeasuredRoundTrip;
use crate::time::{Clock, Exchanges, Reading, Role, Term};
use rohrpost_mailbox::TimeRecord;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// System time on this node at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockSnapshot {
    /// What the node does for the common time.
    pub role: Role,
    /// The master that it follows, or itself.
    pub master: Option<NodeIndex>,
    /// The term that its time follows.
    pub term: Term,
    /// What its page says; by it others compute time, epoch and bound.
    pub record: TimeRecord,
    /// Whether the bound says anything.
    pub synchronised: bool,
    /// How far the page lay from the best guess at the last exchange, ns; positive: it was behind.
    pub offset_ns: i64,
    /// How much faster than its own clock the master's runs, ns a second.
    pub rate_ppb: i64,
    /// Shortest recent round trip, ns.
    pub delay_ns: Option<u64>,
    /// Exchanges so far.
    pub exchanges: u64,
    /// Whether all stamps of the last exchange were the kernel's.
    pub by_kernel: bool,
    /// Datagrams that were not taken.
    pub ignored: u64,
}

impl ClockSnapshot {
    pub(super) fn of(clock: &Clock, now_ns: u64) -> Self {
        let Reading { term, synchronised, .. } = clock.reading(now_ns);
        let Exchanges { count: exchanges, by_kernel } = clock.exchanges();
        Self {
            role: clock.role(),
            master: clock.master(),
            term,
            record: *clock.record(),
            synchronised,
            offset_ns: clock.offset_ns(),
            rate_ppb: clock.rate_ppb(),
            delay_ns: clock.delay_ns(),
            exchanges,
            by_kernel,
            ignored: 0,
        }
    }
}

/// Shared by the clock's thread and its readers.
#[derive(Debug)]
pub struct ClockState {
    snapshot: Mutex<ClockSnapshot>,
    /// Whether a new epoch is asked for.
    new_epoch: AtomicBool,
    round_trip: MeasuredRoundTrip,
}

impl ClockState {
    pub(super) fn new(snapshot: ClockSnapshot) -> Self {
        Self {
            snapshot: Mutex::new(snapshot),
            new_epoch: AtomicBool::new(false),
            round_trip: MeasuredRoundTrip::default(),
        }
    }

    /// The present state. For tools: modules read the node's page.
    pub fn snapshot(&self) -> ClockSnapshot {
        *self.snapshot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The round trip by which this node's clock was measured.
    pub fn round_trip(&self) -> &MeasuredRoundTrip {
        &self.round_trip
    }

    /// Asks the clock's thread to begin a new epoch at this computer's clock; it does within a second if this node is
    /// the master. False: that is asked already.
    pub fn ask_new_epoch(&self) -> bool {
        !self.new_epoch.swap(true, Ordering::Relaxed)
    }

    pub(super) fn take_new_epoch(&self) -> bool {
        self.new_epoch.load(Ordering::Relaxed) && self.new_epoch.swap(false, Ordering::Relaxed)
    }

    /// For the clock's thread. It never waits for a reader: then the next snapshot is shown.
    pub(super) fn show(&self, snapshot: &ClockSnapshot) {
        self.round_trip.set(snapshot.delay_ns);
        if let Ok(mut shown) = self.snapshot.try_lock() {
            *shown = *snapshot;
        }
    }
}
