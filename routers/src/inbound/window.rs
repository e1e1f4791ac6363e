//! Which datagrams of a peer's incarnation have come: duplicates are dropped, and missing ones are counted.
//!
//! ```text
//!      duplicates    lost, unless it still comes        may still come        not yet
//!  ─────────────┬──────────────────────────────────┬─────────────────────┬──────────────▶ sequence
//!           next - 1024                       settled (next - 64)       next
//! ```

/// Sequences that are remembered.
pub const WINDOW: u64 = 1024;
/// How many may overtake a datagram before it counts as lost.
pub const REORDER_MAX: u64 = 64;

/// Result for a sequence.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Arrival {
    /// The newest.
    Newest,
    /// Newer ones came before it.
    Reordered,
    /// It had been counted as lost.
    Returned,
    /// It came before, or is too old to tell.
    Duplicate,
}

/// Sequences of one incarnation of one peer; at first all from 0 on are expected.
#[derive(Debug, Default)]
pub(crate) struct SequenceWindow {
    next: u64,
    /// All below is decided.
    settled: u64,
    /// Sequences before this do not count.
    start: u64,
    came: [u64; (WINDOW / 64) as usize],
    /// `next` as it stood at the last two ticks.
    ticks: [u64; 2],
}

impl SequenceWindow {
    /// Window of an incarnation that may have begun long before us: earlier sequences are not missed. Near its start
    /// both have just begun. Then missing sequences count as lost, even if nothing listened yet: a router sends to a
    /// peer of which it knows nothing, so packages may have been in them, and each must be accounted for.
    pub(crate) fn joining(sequence: u64) -> Self {
        let start = if sequence < REORDER_MAX { 0 } else { sequence };
        Self { next: start, settled: start, start, ticks: [start; 2], ..Self::default() }
    }

    /// Window of an incarnation that was heard before: earlier sequences have come.
    pub(crate) fn going_on(sequence: u64) -> Self {
        let came = [u64::MAX; (WINDOW / 64) as usize];
        Self { next: sequence, settled: sequence, start: sequence, came, ticks: [sequence; 2] }
    }

    /// The sequence expected next.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// Takes a sequence that came, and adds to `lost` what is given up since newer ones have come.
    pub(crate) fn arrive(&mut self, sequence: u64, lost: &mut u64) -> Arrival {
        if sequence >= self.next {
            self.advance(sequence, lost);
            return Arrival::Newest;
        }
        if self.is_duplicate(sequence) {
            return Arrival::Duplicate;
        }
        self.note(sequence);
        if (self.start..self.settled).contains(&sequence) { Arrival::Returned } else { Arrival::Reordered }
    }

    /// Whether a sequence came before, or is too old to tell.
    pub(crate) fn is_duplicate(&self, sequence: u64) -> bool {
        sequence < self.next && (self.next - sequence > WINDOW || self.has(sequence))
    }

    /// Gives up what was missing two ticks ago; returns how many.
    pub(crate) fn tick(&mut self) -> u64 {
        let lost = self.settle(self.ticks[1]);
        self.ticks = [self.next, self.ticks[0]];
        lost
    }

    /// Gives up all that is missing; returns how many.
    pub(crate) fn close(&mut self) -> u64 {
        self.settle(self.next)
    }

    fn advance(&mut self, sequence: u64, lost: &mut u64) {
        let next = sequence + 1;
        // A sequence that leaves the window is decided before its bit is used again.
        let settled = next.saturating_sub(REORDER_MAX);
        *lost += self.settle(settled.min(self.next));
        if settled > self.settled {
            *lost += settled - self.settled;
            self.settled = settled;
        }
        if next - self.next >= WINDOW {
            self.came = [0; (WINDOW / 64) as usize];
        } else {
            (self.next..=sequence).for_each(|skipped| self.came[word(skipped)] &= !bit(skipped));
        }
        self.note(sequence);
        self.next = next;
    }

    fn settle(&mut self, until: u64) -> u64 {
        let lost = (self.settled..until).filter(|sequence| !self.has(*sequence)).count() as u64;
        self.settled = self.settled.max(until);
        lost
    }

    fn has(&self, sequence: u64) -> bool {
        self.came[word(sequence)] & bit(sequence) != 0
    }

    fn note(&mut self, sequence: u64) {
        self.came[word(sequence)] |= bit(sequence);
    }
}

fn word(sequence: u64) -> usize {
    (sequence % WINDOW / 64) as usize
}

fn bit(sequence: u64) -> u64 {
    1 << (sequence % 64)
}
