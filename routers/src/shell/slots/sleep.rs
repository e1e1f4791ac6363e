//! Waking up at a given moment.

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_nanosleep};
use rohrpost_mailbox::monotonic_ns;

const SECOND_NS: u64 = 1_000_000_000;
/// The kernel wakes an ordinary thread so much later than it asks for, if that saves it a wake-up; by default 50 µs.
const SLACK_NS: u64 = 1;

/// Makes the calling thread wake up on time from now on, also if it is an ordinary one.
pub(super) fn be_punctual() {
    // Refused, it wakes up a little later.
    let _ = nix::sys::prctl::set_timerslack(SLACK_NS);
}

/// Sleeps for so long, ns, from now on. Interrupted, it wakes up earlier: the caller looks at the clock anyway.
pub(super) fn sleep(for_ns: u64) {
    let until_ns = monotonic_ns().saturating_add(for_ns);
    let until = TimeSpec::new((until_ns / SECOND_NS).cast_signed(), (until_ns % SECOND_NS).cast_signed());
    let _ = clock_nanosleep(ClockId::CLOCK_BOOTTIME, ClockNanosleepFlags::TIMER_ABSTIME, &until);
}
