//! What the slot driver remembers of the windows that it used.

use crate::tdma::{TransmitWindow, Window};
use crate::time::Stamp;

/// Number of windows that are remembered.
pub const WINDOWS: usize = 16;

/// A window that was used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Used {
    /// Which, in system time.
    pub window: Window,
    /// The first datagram was on the wire so long after the beginning, ns: by the kernel's stamp where there is one,
    /// else when it was handed over and the usual lead. Less than 0: too early.
    pub off_ns: i64,
    /// Whether it was the kernel's stamp.
    pub by_kernel: bool,
    /// Datagrams.
    pub datagrams: u64,
    /// Their bytes on the wire, all heads counted.
    pub wire_bytes: u64,
    /// The last one was decided on when it would still be off the wire so long before the end, ns. Never less than 0.
    pub spare_ns: i64,
    /// The call for the last one came back so long after the end, ns; 0: before it.
    pub over_ns: u64,
}

/// The last windows, and what missed its own.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct WindowLog {
    /// Datagrams that waited for the next slot, since the thread stood still between their making and their leaving.
    pub held: u64,
    /// Windows that were over when the call for their last datagram came back: it may have left outside.
    pub overran: u64,
    /// Slots that began too late, or took too long, for what bounds assume.
    pub behind: u64,
    /// The last windows that were used, the oldest first, as far as there were so many.
    pub windows: [Option<Used>; WINDOWS],
}

impl WindowLog {
    /// A window is over. Its first datagram was handed over so that it was on the wire at `first_ns`, local, by the
    /// usual lead; the call for its last one came back at `back_ns`.
    pub(super) fn used(&mut self, tx_window: &TransmitWindow, first_ns: u64, back_ns: u64) {
        let over_ns = back_ns.saturating_sub(tx_window.end_ns);
        self.overran += u64::from(over_ns > 0);
        self.windows.rotate_left(1);
        self.windows[WINDOWS - 1] = Some(Used {
            window: tx_window.window,
            off_ns: first_ns.wrapping_sub(tx_window.begin_ns).cast_signed(),
            by_kernel: false,
            datagrams: tx_window.datagrams(),
            wire_bytes: tx_window.wire_bytes(),
            spare_ns: tx_window.spare_ns(),
            over_ns,
        });
    }

    /// When the first datagram of the last window left, which began at `begin_ns`, local.
    pub(super) fn left(&mut self, begin_ns: u64, stamp: Stamp) {
        if let Some(Some(used)) = self.windows.last_mut() {
            used.off_ns = stamp.ns.wrapping_sub(begin_ns).cast_signed();
            used.by_kernel = stamp.by_kernel;
        }
    }
}
