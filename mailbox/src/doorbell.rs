//! Sleeping and waking: a futex word that every participant has, its bell.
//!
//! ```text
//! receiver: sleeping = 1 │ fence │ look at the hints │ sleep while bell == seen │ sleeping = 0
//! sender:   publish, hint │ fence │ sleeping? ──▶ bell += 1, wake
//! ```
//! The receiver reads the bell before it says that it sleeps; so a ring after its last look changes the word it would
//! sleep on. One bell serves all mailboxes of a participant, so waiting on several is waiting on one.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Sleeps while `bell` still is `seen`, at most for `timeout`. May return early, for no reason or for a signal.
pub(crate) fn sleep(bell: &AtomicU32, seen: u32, timeout: Option<Duration>) {
    let timeout = timeout.map(|timeout| libc::timespec {
        tv_sec: libc::time_t::try_from(timeout.as_secs()).unwrap_or(libc::time_t::MAX),
        tv_nsec: timeout.subsec_nanos() as _,
    });
    let timeout = timeout.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
    // SAFETY: the word and the timeout outlive the call; FUTEX_WAIT reads both and writes neither.
    unsafe { libc::syscall(libc::SYS_futex, bell.as_ptr(), libc::FUTEX_WAIT, seen, timeout) };
}

/// Wakes whoever sleeps on the bell, or keeps them from falling asleep.
pub(crate) fn ring(bell: &AtomicU32) {
    // ORDERING: Release; what the ringer did before is seen by whoever then reads the bell. The word changes before the
    // wake, else a sleeper that is just about to sleep would miss both.
    bell.fetch_add(1, Ordering::Release);
    // SAFETY: FUTEX_WAKE only uses the address of the word, which is mapped.
    unsafe { libc::syscall(libc::SYS_futex, bell.as_ptr(), libc::FUTEX_WAKE, i32::MAX) };
}
