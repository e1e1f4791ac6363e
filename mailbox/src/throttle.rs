//! Tells of what happens again and again, at most so often, with a count.

/// Limits reports of one event. Asks no clock.
///
/// ```
/// use rohrpost_mailbox::Throttle;
/// const EVERY_NS: u64 = 1_000_000_000;
/// let mut throttle = Throttle::default();
/// assert_eq!(throttle.note(5, EVERY_NS), Some(1), "the first is reported at once");
/// assert_eq!(throttle.note(6, EVERY_NS), None);
/// assert_eq!(throttle.note(5 + EVERY_NS, EVERY_NS), Some(2), "with those in between");
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Throttle {
    not_before_ns: u64,
    events: u64,
}

impl Throttle {
    /// Counts an event; if it is to be reported, how many there were since the last report, this one included.
    pub fn note(&mut self, now_ns: u64, every_ns: u64) -> Option<u64> {
        self.events += 1;
        if now_ns < self.not_before_ns {
            return None;
        }
        self.not_before_ns = now_ns.saturating_add(every_ns);
        Some(std::mem::take(&mut self.events))
    }
}
