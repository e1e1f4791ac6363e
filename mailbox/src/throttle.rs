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
        self.note_all(now_ns, every_ns, 1)
    }

    /// Counts so many events at once; none at all is a look whether earlier ones are to be reported now.
    ///
    /// ```
    /// # use rohrpost_mailbox::Throttle;
    /// let mut throttle = Throttle::default();
    /// assert_eq!([(1, 5), (2, 7)].map(|(now_ns, events)| throttle.note_all(now_ns, 100, events)), [Some(5), None]);
    /// assert_eq!([99, 101, 300].map(|now_ns| throttle.note_all(now_ns, 100, 0)), [None, Some(7), None]);
    /// ```
    pub fn note_all(&mut self, now_ns: u64, every_ns: u64, events: u64) -> Option<u64> {
        self.events = self.events.saturating_add(events);
        self.take_due(now_ns, every_ns, 1)
    }

    /// The same, with `burst` reports at once after a pause.
    pub fn note_burst(&mut self, now_ns: u64, every_ns: u64, burst: u32) -> Option<u64> {
        self.events += 1;
        self.take_due(now_ns, every_ns, burst)
    }

    /// The events that were not reported, if there are some and it is time: the end of a flood is reported, too.
    ///
    /// ```
    /// # use rohrpost_mailbox::Throttle;
    /// let mut throttle = Throttle::default();
    /// assert_eq!([1, 2, 3].map(|now_ns| throttle.note_burst(now_ns, 100, 2)), [Some(1), Some(1), None]);
    /// assert_eq!([100, 101, 300].map(|now_ns| throttle.take_due(now_ns, 100, 2)), [None, Some(1), None]);
    /// ```
    pub fn take_due(&mut self, now_ns: u64, every_ns: u64, burst: u32) -> Option<u64> {
        let room_ns = every_ns.saturating_mul(u64::from(burst.saturating_sub(1)));
        if self.events == 0 || now_ns.saturating_add(room_ns) < self.not_before_ns {
            return None;
        }
        self.not_before_ns = self.not_before_ns.max(now_ns).saturating_add(every_ns);
        Some(std::mem::take(&mut self.events))
    }
}
