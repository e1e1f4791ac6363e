//! The one way out of a process to the collector: the thread that has it sends.

use super::OutputLine;
use rohrpost_mailbox::{Name, Participant, Sender};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

/// When a collector that was not there is looked for again: first after this time, then after twice as long as before,
const RETRY: Duration = Duration::from_millis(200);
/// at last so often. What it costs a module that it never comes is one look in that time.
const RETRY_MAX: Duration = Duration::from_secs(3);

/// The one way out of a process, however many modules it speaks for.
#[derive(Default)]
pub(super) struct Out {
    way: Mutex<Outlet>,
    /// Whether `way` holds a line back.
    pub(super) held: AtomicBool,
    /// Until then nothing is sent.
    quiet_until: Option<Instant>,
}

impl Out {
    /// One by which nothing is sent for so long.
    pub(super) fn quiet(quiet: Duration) -> Self {
        let quiet_until = (!quiet.is_zero()).then(|| Instant::now() + quiet);
        Self { way: Mutex::new(Outlet { retry_at: quiet_until, ..Outlet::default() }), quiet_until, ..Self::default() }
    }

    /// Whether nothing is sent yet.
    pub(super) fn is_quiet(&self) -> bool {
        self.quiet_until.is_some_and(|until| Instant::now() < until)
    }

    /// None: another thread has it.
    pub(super) fn way(&self) -> Option<MutexGuard<'_, Outlet>> {
        match self.way.try_lock() {
            Ok(way) => Some(way),
            Err(TryLockError::Poisoned(way)) => Some(way.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

#[derive(Default)]
pub(super) struct Outlet {
    pub(super) sender: Option<Sender>,
    pub(super) retry_at: Option<Instant>,
    /// How often in a row it was not there.
    pub(super) failures: u32,
    /// The line that found no room; it goes before all that wait.
    pub(super) held: Option<OutputLine>,
    pub(super) bytes: Vec<u8>,
    pub(super) sequence: u32,
}

impl Outlet {
    /// Whether the collector is there; it is looked for when it is time.
    pub(super) fn open(&mut self, participant: &Arc<Participant>, to: Name) -> bool {
        if self.retry_at.is_some_and(|at| Instant::now() < at) {
            return false;
        }
        if self.sender.is_none() {
            self.sender = participant.sender(to).ok();
            self.retry_at = self.sender.is_none().then(|| Instant::now() + self.away());
        }
        self.sender.is_some()
    }

    /// The collector is not there: when it is looked for again.
    pub(super) fn away(&mut self) -> Duration {
        let wait = RETRY.saturating_mul(1 << self.failures.min(16)).min(RETRY_MAX);
        self.failures = self.failures.saturating_add(1);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_collector_that_stays_away_is_looked_for_less_and_less() {
        let mut way = Outlet::default();
        let waits: Vec<u128> = (0..6).map(|_| way.away().as_millis()).collect();
        assert_eq!(waits, [200, 400, 800, 1600, 3000, 3000]);
        way.failures = u32::MAX;
        assert_eq!(way.away(), RETRY_MAX);
        way.failures = 0;
        assert_eq!(way.away(), RETRY);
    }
}
