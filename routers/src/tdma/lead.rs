//! The lead: the time from the send call to the wire. Calls are made earlier by that much.

use crate::time::Stamp;

/// Latest samples that make the median.
const HISTORY: usize = 64;
/// The lead is the minimum of this many samples and of as many before.
const LEAST_OF: u32 = 1024;
/// Samples before the lead is used: one that is shorter than the minimum is rare by then.
const KNOWN_FROM: u32 = 256;
/// A longer sample was delayed by something else.
const LEAD_NS_MAX: u64 = 1_000_000;
/// A stamp with a larger error is ignored.
const DOUBT_NS_MAX: u32 = 2_000;

/// From user call to kernel stamp, of the first datagrams of windows.
#[derive(Clone, Debug)]
pub(super) struct Lead {
    latest: [u64; HISTORY],
    count: usize,
    next: usize,
    median_ns: u64,
    /// The least of the present span of [`LEAST_OF`], and of the one before.
    least: [u64; 2],
    in_span: u32,
}

impl Default for Lead {
    fn default() -> Self {
        Self { latest: [0; HISTORY], count: 0, next: 0, median_ns: 0, least: [u64::MAX; 2], in_span: 0 }
    }
}

impl Lead {
    /// A datagram was handed over at `user_ns` and left then.
    pub(super) fn add(&mut self, user_ns: u64, left: Stamp) {
        let earliest_ns = left.ns.saturating_sub(left.doubt_ns.into());
        let took_ns = earliest_ns.saturating_sub(user_ns);
        if !left.by_kernel || left.doubt_ns > DOUBT_NS_MAX || took_ns > LEAD_NS_MAX {
            return;
        }
        self.latest[self.next] = took_ns;
        self.next = (self.next + 1) % HISTORY;
        self.count = (self.count + 1).min(HISTORY);
        let mut latest = self.latest;
        let latest = &mut latest[..self.count];
        latest.sort_unstable();
        self.median_ns = latest[self.count / 2];
        self.least[0] = self.least[0].min(took_ns);
        self.in_span += 1;
        if self.in_span == LEAST_OF {
            (self.least, self.in_span) = ([u64::MAX, self.least[0]], 0);
        }
    }

    /// The median, ns.
    pub(super) fn median_ns(&self) -> u64 {
        self.median_ns
    }

    /// How much earlier a call may be, ns: no measured frame would have left too early.
    pub(super) fn ns(&self) -> u64 {
        let is_known = self.least[1] < u64::MAX || self.in_span >= KNOWN_FROM;
        if !is_known {
            return 0;
        }
        self.median_ns.min(self.least[0]).min(self.least[1])
    }
}
