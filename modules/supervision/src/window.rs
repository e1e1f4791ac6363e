//! How often something happened lately.

/// At most so many are remembered.
pub(crate) const REMEMBERED: usize = 16;

/// The last times at which something happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Window {
    /// In the order of time from `next` on, round about.
    at_ns: [Option<u64>; REMEMBERED],
    next: usize,
}

impl Window {
    /// One more, now.
    pub(crate) fn push(&mut self, now_ns: u64) {
        self.at_ns[self.next] = Some(now_ns);
        self.next = (self.next + 1) % REMEMBERED;
    }

    /// How often in the last `within_ns`, now included; at most [`REMEMBERED`].
    pub(crate) fn count(&self, now_ns: u64, within_ns: u64) -> usize {
        self.at_ns.iter().flatten().filter(|at_ns| now_ns.saturating_sub(**at_ns) < within_ns).count()
    }
}
