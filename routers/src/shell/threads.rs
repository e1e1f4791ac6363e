//! What the threads of a router share, and how they are scheduled.

use rohrpost_config::FIFO_MAX;
use rohrpost_mailbox::{Participant, sys};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Above every module: a router that waits for a module's work keeps others' packages waiting. This is the thread that sends.
pub(super) const DEPARTURES_FIFO: u8 = FIFO_MAX + 9;
/// Of the thread that receives: a flood of what leaves must not keep answers from coming in; it sleeps whenever the socket is empty.
pub(super) const ARRIVALS_FIFO: u8 = DEPARTURES_FIFO + 1;
/// A thread that has not slept for so long is made to, for this short time. A flood that a processor cannot carry would keep a router
/// awake for good, and it stands above all modules: so those on its processor get a little of each of these spans, and the kernel,
/// which ends real-time processes that work without pause (RLIMIT_RTTIME), has no reason to.
const AWAKE_MAX_NS: u64 = 2_000_000;
const PAUSE_NS: u64 = 50_000;
/// Who was away for so long has slept, and others had the processor.
const SLEPT_NS: u64 = 10_000;

/// What both threads see.
pub(super) struct Shared {
    ends: AtomicBool,
    /// When the sending thread wants to be woken, ns; it sleeps without a timeout, since that costs less.
    pub(super) departures_due_ns: AtomicU64,
    /// Bytes of packets from the tunnel that wait in the queue, as the sending thread last saw it.
    pub(super) tunnel_bytes: AtomicU64,
    /// Of the sending thread, whose bell wakes it.
    tx_thread: Arc<Participant>,
}

impl Shared {
    pub(super) fn new(tx_thread: &Arc<Participant>) -> Self {
        Self {
            ends: AtomicBool::new(false),
            departures_due_ns: AtomicU64::new(u64::MAX),
            tunnel_bytes: AtomicU64::new(0),
            tx_thread: tx_thread.clone(),
        }
    }

    /// Whether the router ends.
    pub(super) fn ends(&self) -> bool {
        self.ends.load(Ordering::Acquire)
    }

    /// From now on it does.
    pub(super) fn end(&self) {
        self.ends.store(true, Ordering::Release);
        self.tx_thread.ring();
    }

    /// Wakes the sending thread: it has something to send that nobody published.
    pub(super) fn ring(&self) {
        self.tx_thread.ring();
    }

    /// Wakes the sending thread if its time has come. Said again until that sleeps anew: who is about to sleep may not hear it.
    pub(super) fn ring_if_due(&self, now_ns: u64) {
        if self.departures_due_ns.load(Ordering::Acquire) <= now_ns {
            self.tx_thread.ring();
        }
    }
}

/// Sees to it that a thread sleeps now and then.
#[derive(Default)]
pub(super) struct Awake {
    /// Since when; none: since the next look.
    since_ns: Option<u64>,
}

impl Awake {
    /// The thread was away for so long; what is very short was no sleep.
    pub(super) fn slept(&mut self, time: Duration) {
        if time.as_nanos() > SLEPT_NS.into() {
            self.since_ns = None;
        }
    }

    /// Called again and again, with the time; pauses if the thread has not slept for long.
    pub(super) fn pause_if_long(&mut self, now_ns: u64) {
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns) > AWAKE_MAX_NS {
            std::thread::sleep(Duration::from_nanos(PAUSE_NS));
            self.since_ns = None;
        }
    }
}

/// Schedules the calling thread above all modules. If that is not allowed, it runs as the rest of its process does.
///
/// # Errors
/// What the system said.
pub(super) fn schedule(fifo: u8) -> std::io::Result<()> {
    sys::schedule(sys::Scheduling::Fifo(fifo))
}

/// Schedules the calling thread as modules are that are not real time: below all that are, whatever its process is.
pub(super) fn schedule_below() {
    // Who has real time may give it up.
    let _ = sys::schedule(sys::Scheduling::Normal(0));
}
