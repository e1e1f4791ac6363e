//! For how long a slot driver sleeps, spins and reads.

use rohrpost_network::TRANSIT_LOOK;

/// The thread wakes up so much before the call, to read what came and to spin. Measured on a virtual machine with both
/// processors busy: it wakes up 50 µs late on average, and to read takes 30 µs.
const SPIN_NS_MAX: u64 = 150_000;
/// Spinning for one window takes at most this fraction of the cycle: short cycles leave less time for it.
const SPIN_CYCLES: u64 = 20;
/// Syncs that came since it woke up are looked for so long before the call: to read one takes some microseconds.
pub(super) const LAST_LOOK_NS: u64 = 50_000;
/// Whether the mailbox is full is looked at this often: half of it has room for a burst of 32 packages.
pub(super) const NAP_NS: u64 = 1_000_000;
/// With less than this until it has to wake up it sleeps on: each look at the mailbox keeps a processor from another
/// thread, perhaps one that is about to send.
pub(super) const SLEEP_NS_MAX: u64 = NAP_NS + NAP_NS / 4;
const _: () = assert!(
    (SLEEP_NS_MAX + SPIN_NS_MAX) as u128 <= TRANSIT_LOOK.as_nanos(),
    "bounds of declared flows count on it, that what waits does not overflow meanwhile"
);
/// Datagrams of time that are read at a look, besides one for each node: reading one takes some microseconds.
pub(super) const LOOK_BURST: usize = 16;
/// Handling what waits takes less than this, unless much waits.
pub(super) const TIDY_NS: u64 = 250_000;

/// What a slot driver does until the next poll.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SlotStep {
    /// Sleep, ns from now on.
    Sleep {
        /// For so long.
        for_ns: u64,
    },
    /// Spin: packages that come meanwhile are taken. Nothing else is due before then, local ns.
    Spin {
        /// Until when.
        until_ns: u64,
    },
}

/// How long before the call the thread that sends in time slots is to wake up, ns; then it spins.
pub fn spin_ns(cycle_ns: u64) -> u64 {
    SPIN_NS_MAX.min(cycle_ns / SPIN_CYCLES)
}
