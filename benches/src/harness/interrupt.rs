//! Ctrl-C: what runs is ended and what was made is removed, as at any other end.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on a signal to end only says so, by [`interrupted`]. The processes of a turn inherit that: their parent ends them.
pub fn heed() {
    let flag = INTERRUPTED.get_or_init(Arc::default);
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        // Refused, the signal ends the process as it always does, and the next run removes what is left.
        let _ = signal_hook::flag::register(signal, flag.clone());
    }
}

/// Whether somebody wants an end.
pub fn interrupted() -> bool {
    INTERRUPTED.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}
