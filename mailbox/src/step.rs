//! Crash points: named steps at which a process can be told to die, so that a test can visit every instruction boundary
//! that matters. Each has a name and a line of its own, and `mailbox/proof/crash` shows that each is died at. They are
//! nothing at all without the feature `crash-points`.

/// A step of an operation on shared memory: with the feature `crash-points`, the armed one aborts the process here.
macro_rules! step {
    ($what:literal) => {
        #[cfg(feature = "crash-points")]
        $crate::step::reached($what);
    };
}
pub(crate) use step;

#[cfg(feature = "crash-points")]
pub use armed::{arm, reached};

#[cfg(feature = "crash-points")]
mod armed {
    use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

    static COUNT: AtomicU64 = AtomicU64::new(0);
    static FATAL: AtomicU64 = AtomicU64::new(u64::MAX);

    /// Counts from here on; the `fatal`-th step (1 is the first) kills the process as SIGKILL would.
    pub fn arm(fatal: u64) {
        COUNT.store(0, SeqCst);
        FATAL.store(fatal, SeqCst);
    }

    /// Called by each step.
    pub fn reached(what: &str) {
        if COUNT.fetch_add(1, SeqCst) + 1 == FATAL.load(SeqCst) {
            eprintln!("{what}");
            std::process::abort();
        }
    }
}
