//! How long it takes from the call to the wire, so that the call can be made so much earlier.

use crate::broken::broken;
use crate::time::Stamp;

/// So many of the latest count for the median.
const HISTORY: usize = 64;
/// The least of so many and as many before counts for what may be relied on.
const LEAST_OF: u32 = 1024;
/// Calls are made earlier when so many have been measured: one that is quicker than the least of them is seldom.
const KNOWN_FROM: u32 = 256;
/// What took longer was kept up by something else.
const LEAD_NS_MAX: u64 = 1_000_000;
/// A stamp that may be further off says too little.
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

    /// Half of the latest took no longer, ns.
    pub(super) fn median_ns(&self) -> u64 {
        self.median_ns
    }

    /// By how much a call may be earlier, ns, and yet no frame has been seen that would have left too early.
    pub(super) fn ns(&self) -> u64 {
        let is_known = self.least[1] < u64::MAX || self.in_span >= KNOWN_FROM;
        if !is_known {
            return 0;
        }
        if broken!(LeadTooLong) { 2 * self.median_ns } else { self.median_ns.min(self.least[0]).min(self.least[1]) }
    }
}
