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

/// Looks each so often, and gives what is found; none if nothing is in time.
///
/// # Errors
/// What looking fails with, or when a signal asks for an end meanwhile.
pub fn look_for<T>(
    within: Duration,
    each: Duration,
    mut look: impl FnMut() -> Result<Option<T>, Failure>,
) -> Result<Option<T>, Failure> {
    let give_up = Instant::now() + within;
    loop {
        match look()? {
            None if Instant::now() > give_up => return Ok(None),
            None if interrupted() => return Err(Failure::Failed("interrupted".into())),
            None => std::thread::sleep(each),
            found => return Ok(found),
        }
    }
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
