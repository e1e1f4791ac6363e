//! State that the threads of a router share, and their scheduling.

use rohrpost_config::FIFO_MAX;
use rohrpost_mailbox::{Participant, sys};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Priority of the sending thread, above every module: a router that waits for a module delays other modules' packages.
pub(super) const TX_FIFO: u8 = FIFO_MAX + 9;
/// Priority of the receiving thread: a flood of outgoing packages must not keep answers from coming in. It sleeps when
/// the socket is empty.
pub(super) const RX_FIFO: u8 = TX_FIFO + 1;
/// A thread that has not slept for this long sleeps for a short time. A flood could keep a router awake forever, and it
/// runs above all modules. So the modules on its processor get a part of each of these spans, and the kernel, which
/// kills real-time processes that never sleep (RLIMIT_RTTIME), has no reason to.
const AWAKE_MAX_NS: u64 = 2_000_000;
const PAUSE_NS: u64 = 50_000;
/// A thread that was off the processor for this long has slept, and others ran.
const SLEPT_NS: u64 = 10_000;

/// State that both threads share.
pub(super) struct Shared {
    ends: AtomicBool,
    /// When the sending thread wants to be woken, ns; it sleeps without a timeout, since that costs less.
    pub(super) departures_due_ns: AtomicU64,
    /// Bytes of tunnel packets in the queue, as the sending thread last saw it.
    pub(super) tunnel_bytes: AtomicU64,
    /// The sending thread, with the bell that wakes it.
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

    /// Ends the router.
    pub(super) fn end(&self) {
        self.ends.store(true, Ordering::Release);
        self.tx_thread.ring();
    }

    /// Wakes the sending thread: it has something to send that was not published.
    pub(super) fn ring(&self) {
        self.tx_thread.ring();
    }

    /// Wakes the sending thread if it is due. Repeated until it sleeps anew: a thread that is about to sleep may miss a
    /// ring.
    pub(super) fn ring_if_due(&self, now_ns: u64) {
        if self.departures_due_ns.load(Ordering::Acquire) <= now_ns {
            self.tx_thread.ring();
        }
    }
}

/// Makes a thread sleep now and then.
#[derive(Default)]
pub(super) struct Awake {
    /// Awake since then; none: since the next look.
    since_ns: Option<u64>,
}

impl Awake {
    /// The thread was away for this long; very short spans are no sleep.
    pub(super) fn slept(&mut self, time: Duration) {
        if time.as_nanos() > SLEPT_NS.into() {
            self.since_ns = None;
        }
    }

    /// Call it again and again, with the time; it pauses if the thread has not slept for long.
    pub(super) fn pause_if_long(&mut self, now_ns: u64) {
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns) > AWAKE_MAX_NS {
            std::thread::sleep(Duration::from_nanos(PAUSE_NS));
            self.since_ns = None;
        }
    }
}

/// Schedules the calling thread above all modules. If that is not allowed, it keeps the scheduling of its process.
///
/// # Errors
/// The system's error.
pub(super) fn schedule(fifo: u8) -> std::io::Result<()> {
    sys::schedule(sys::Scheduling::Fifo(fifo))
}

/// Schedules the calling thread like modules that are not real time: below all that are, whatever its process is.
pub(super) fn schedule_below() {
    // A thread may always give up real time.
    let _ = sys::schedule(sys::Scheduling::Normal(0));
}
