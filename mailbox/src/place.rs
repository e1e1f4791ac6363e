//! Where a sender looks for a free slot first.

use crate::slots::word::Claimant;

/// Where a sender looks for a free slot first.
///
/// While the receiver keeps up, the sender rotates through a few slots: their cache lines stay in both caches, and the
/// next can be fetched while the receiver reads the last. When these are in use, the search goes on through all slots
/// from the last position, so a long queue is not searched again for each package.
pub(crate) struct Place {
    /// The slot that the next search begins with, if it is not for the home.
    cursor: usize,
    /// First of the few. Senders have different ones, so that they meet less.
    home: usize,
    /// Which of the few is next.
    turn: usize,
    /// Searches until the home is tried again.
    away: u32,
}

impl Place {
    /// Slots of a home.
    const HOME: usize = 4;
    /// Searches for which the home is left alone after its next slot was in use.
    const AWAY: u32 = 32;

    pub(crate) fn of(me: Claimant) -> Self {
        let home = usize::from(me.participant) * 7;
        Self { cursor: home, home, turn: 0, away: 0 }
    }

    /// The slot that will be looked at first, of so many.
    pub(crate) fn next(&self, count: usize) -> usize {
        let number = if self.away == 0 { self.home + self.turn } else { self.cursor };
        // Mostly it is a slot already, and a division costs as much as all other steps of a search.
        if number < count { number } else { number % count }
    }

    pub(crate) fn first(&mut self, count: usize) -> &mut usize {
        self.cursor = self.next(count);
        &mut self.cursor
    }

    pub(crate) fn found(&mut self, slot: usize, count: usize) {
        if self.away > 0 {
            self.away -= 1;
        } else if slot == self.next(count) {
            self.turn = (self.turn + 1) % Self::HOME;
        } else {
            self.away = Self::AWAY;
        }
    }
}
