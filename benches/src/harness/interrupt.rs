//! Ctrl-C: what runs is ended and what was made is removed, as at any other end.

use super::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Who waits for long looks this often.
const LOOK_EACH: Duration = Duration::from_millis(50);

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

/// Sleeps for so long.
///
/// # Errors
/// When somebody wants an end meanwhile.
pub fn rest(duration: Duration) -> Result<(), Failure> {
    let over = Instant::now() + duration;
    while !interrupted() {
        match over.saturating_duration_since(Instant::now()) {
            Duration::ZERO => return Ok(()),
            left => std::thread::sleep(left.min(LOOK_EACH)),
        }
    }
    Err(Failure::Failed("interrupted".into()))
}
