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
    /// The last one was decided on when it would still be off the wire so long before the end, ns. Never less than 0.
    pub spare_ns: i64,
    /// The call for the last one came back so long after the end, ns; 0: not after it.
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
    /// A window is over. If there were datagrams, the first was handed over so that it was on the wire at `first_ns`,
    /// local, by the usual lead.
    pub(super) fn closed(&mut self, tx_window: &TransmitWindow, first_ns: u64) {
        self.behind += u64::from(tx_window.fell_behind);
        if tx_window.datagrams() == 0 {
            return;
        }
        let over_ns = tx_window.over_ns();
        self.overran += u64::from(over_ns > 0);
        self.windows.rotate_left(1);
        self.windows[WINDOWS - 1] = Some(Used {
            window: tx_window.window,
            off_ns: first_ns.wrapping_sub(tx_window.begin_ns).cast_signed(),
            by_kernel: false,
            datagrams: tx_window.datagrams(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::tdma;
    use crate::tdma::{Carries, WindowKind, Wire};

    #[test]
    fn a_window_that_was_over_when_its_last_call_came_back_is_counted() {
        let tdma = tdma([10_000, 1000, 1000], Vec::new());
        let wire = Wire::new(&tdma, 28);
        let window = Window { kind: WindowKind::Slot { index: 0 }, cycle: 0, begin_ns: 1_000_000, end_ns: 2_000_000 };
        let mut log = WindowLog::default();
        for (back_ns, over_ns, overran) in [(900, 0, 0), (1000, 0, 0), (1001, 1, 1), (5000, 4000, 2)] {
            let mut tx_window = TransmitWindow::new(window, 100, 1000, Carries::All, 0, wire);
            tx_window.takes(500, 0);
            tx_window.returns(back_ns);
            log.closed(&tx_window, 500);
            let used = log.windows[WINDOWS - 1].unwrap();
            assert_eq!((used.over_ns, log.overran), (over_ns, overran), "back at {back_ns} ns");
            assert_eq!(used.spare_ns, tx_window.spare_ns(), "as it was decided");
        }
        let mut unused = TransmitWindow::new(window, 100, 1000, Carries::All, 0, wire);
        unused.fell_behind = true;
        log.closed(&unused, 500);
        assert_eq!((log.overran, log.behind), (2, 1), "nothing left in it, and nothing outside");
    }
}
