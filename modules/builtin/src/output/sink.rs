//! What becomes of a sink of lines that fails: it is said once, tried again, and said when it works again.

use std::io;
use std::time::{Duration, Instant};

/// A sink that failed is tried again so often.
const RETRY: Duration = Duration::from_secs(1);

/// A change that somebody should be told of.
#[derive(Debug)]
pub(super) enum SinkChange {
    /// From now on lines are missing there.
    Fails(io::Error),
    /// The sink works again; so many lines are missing.
    Works(u64),
}

/// Whether a sink works.
#[derive(Default)]
pub(super) struct SinkHealth {
    /// None while it works.
    retry_at: Option<Instant>,
    missing: u64,
}

impl SinkHealth {
    /// Tries to put a line there, unless that failed a moment ago.
    pub(super) fn put(&mut self, now: Instant, put: impl FnOnce() -> io::Result<()>) -> Option<SinkChange> {
        if self.retry_at.is_some_and(|at| now < at) {
            self.missing += 1;
            return None;
        }
        match put() {
            Ok(()) => {
                self.retry_at.take()?;
                Some(SinkChange::Works(std::mem::take(&mut self.missing)))
            }
            Err(error) => {
                self.missing += 1;
                let failed_before = self.retry_at.replace(now + RETRY).is_some();
                (!failed_before).then_some(SinkChange::Fails(error))
            }
        }
    }
}
