//! Whether this process became a child by `fork`: what was opened before belongs to its parent.

use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// How often that has happened.
static FORKS: AtomicU32 = AtomicU32::new(0);

extern "C" fn count() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// Counts forks from now on.
pub(crate) fn watch() {
    static WATCH: Once = Once::new();
    // SAFETY: the function only changes an atomic, which a child of a process with threads may do. (Without memory for
    // it, forks go unseen, and so does everything else soon.)
    WATCH.call_once(|| _ = unsafe { libc::pthread_atfork(None, None, Some(count)) });
}

/// How often this process became a child since they are counted.
#[inline]
pub(crate) fn forks() -> u32 {
    // ORDERING: Relaxed; a child has one thread, which has counted.
    FORKS.load(Ordering::Relaxed)
}
