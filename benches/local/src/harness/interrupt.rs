//! Ctrl-C: ends running processes and removes files, as at any other end.

use super::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// A long wait polls this often.
const LOOK_EACH: Duration = Duration::from_millis(50);

static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on a terminating signal only sets [`interrupted`]. The processes of a turn inherit that: their parent ends
/// them.
pub fn heed() {
    let flag = INTERRUPTED.get_or_init(Arc::default);
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        // If the handler is refused, the signal ends the process as usual, and the next run removes the files.
        let _ = signal_hook::flag::register(signal, flag.clone());
    }
}

/// Whether a signal asked for an end.
pub fn interrupted() -> bool {
    INTERRUPTED.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Sleeps for so long.
///
/// # Errors
/// When a signal asks for an end meanwhile.
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
