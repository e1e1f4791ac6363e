//! A participant's bell: how often it was rung, and whether its sleeper must be told through a pipe.
//!
//! ```text
//! sleeper:  seen = rings │ (F) last look │ polling = 1 │ (I) │ rings == seen? ──▶ poll(pipe, …) │ polling = 0
//! ringer:   rings += 1 │ (H) │ polling? ──▶ a byte into the pipe
//! ```
//! A receiver that waits for mailboxes alone sleeps on the word `rings` itself, and the kernel compares it. One that
//! waits for file descriptors too sleeps in `poll`, which compares no words. So the sleeper compares, and a ringer that
//! comes later writes into a pipe. Of a sleeper and a ringer at least one sees the other. Each ringer that sees the
//! mark writes, even if another wrote before: so a ringer that dies before it writes takes away no wake-up but its own.
//! Nothing here makes a system call (see `doorbell`), so that loom can check it as it stands.

use crate::step::step;
use crate::sync::{AtomicU32, Ordering, fence};

/// The two words in the participant's entry.
#[derive(Clone, Copy)]
pub(crate) struct Bell<'a> {
    pub(crate) rings: &'a AtomicU32,
    /// Not 0: the sleeper is in `poll`, or about to be. Written by it alone.
    pub(crate) polling: &'a AtomicU32,
}

impl Bell<'_> {
    /// Rings so far. Read before the last look at whatever one sleeps for.
    pub(crate) fn seen(&self) -> u32 {
        // ORDERING: Acquire; what the ringers did before is seen by the looks that follow.
        self.rings.load(Ordering::Acquire)
    }

    /// Rings; true when the sleeper is to be told through its pipe.
    pub(crate) fn ring(&self) -> bool {
        // ORDERING: Release; a thread that then reads the bell sees what the ringer did before.
        self.rings.fetch_add(1, Ordering::Release);
        // ORDERING (H): the ring before the look at `polling`. Pairs with (I).
        fence(Ordering::SeqCst);
        step!("bell: rung");
        self.polling.load(Ordering::Relaxed) != 0
    }

    /// Says that the sleeper goes to sleep in `poll`; false when somebody has rung since `seen`. Then,
    /// [`Bell::polled`].
    pub(crate) fn may_poll(&self, seen: u32) -> bool {
        self.polling.store(1, Ordering::Relaxed);
        // ORDERING (I): `polling` before the last look at the rings. Pairs with (H).
        fence(Ordering::SeqCst);
        step!("bell: polling");
        self.rings.load(Ordering::Relaxed) == seen
    }

    /// The sleeper is back. A ringer that still sees the mark writes a byte that wakes it once for nothing.
    pub(crate) fn polled(&self) {
        self.polling.store(0, Ordering::Relaxed);
    }
}
