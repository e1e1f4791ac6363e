//! The word of a slot: the only truth about it, 64 bits that change by one compare-and-swap at a time.
//!
//! ```text
//!  63 62  61        53  52      48 47         32 31                      0
//!  ┌────┬───┬─────────┬─┬────────┬─────────────┬──────────────────────────┐
//!  │Fill│ v │ victim  │n│  zero  │ participant │ incarnation              │  v: took the place of an accepted package
//!  └────┴───┴─────────┴─┴────────┴─────────────┴──────────────────────────┘  of priority `victim`; n: as its newer one
//!  63 62  61        54  53  52                                            0
//!  ┌────┬─────────────┬───┬───────────────────────────────────────────────┐
//!  │R/T │ priority    │ r │ ticket                                        │  r: redelivered after its receiver died
//!  └────┴─────────────┴───┴───────────────────────────────────────────────┘
//! ```
//!
//! The states of a slot, and which process may make each change:
//!
//! ```text
//!            claim (sender)               publish (its filler)            take (receiver)
//!   Free ───────────────────▶ Filling ───────────────────────▶ Ready ──────────────────▶ Taken
//!    ▲                        │  ▲                              │ ▲                       │ │
//!    ├──── abandon, reclaim ──┘  └── displace (other sender), ──┤ └── adopt (new owner) ──┘ │
//!    │                               reuse (its sender)         │                           │
//!    ├────────────────────────────── replace (its sender) ──────┘                           │
//!    └─────────────────────────── release (receiver), poison (new owner) ────────────────────┘
//! ```

use crate::name::Priority;

const STATE: u32 = 62;
const FILLING: u64 = 1;
const READY: u64 = 2;
const TAKEN: u64 = 3;
const HAS_VICTIM: u64 = 1 << 61;
const VICTIM: u32 = 53;
const NEWER: u64 = 1 << 52;
const PARTICIPANT: u32 = 32;
const PRIORITY: u32 = 54;
const REDELIVERED: u64 = 1 << 53;
const RANK: u32 = 53;
/// Tickets have 53 bits: at ten million packages a second they last 28 years.
const TICKET: u64 = REDELIVERED - 1;

/// A slot nobody uses.
pub(crate) const FREE: Word = Word(0);

/// The sender that fills a slot: an entry of the node's table of participants, and which use of that entry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Claimant {
    /// Index in the node's table of participants.
    pub participant: u16,
    /// Never the same twice on a node.
    pub incarnation: u32,
}

/// An accepted package that lost its place to one that is being written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Victim {
    pub(crate) priority: Priority,
    /// What is being written is its own sender's newer one; else it is a more important one.
    pub(crate) replaced: bool,
}

/// The word of a slot as it was read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Word(pub(crate) u64);

/// What a [`Word`] says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum State {
    /// Anybody may claim it.
    Free,
    /// A sender writes its package, for which perhaps an accepted one had to go.
    Filling { by: Claimant, victim: Option<Victim> },
    /// An accepted package waits.
    Ready,
    /// The receiver reads it.
    Taken,
}

impl Word {
    pub(crate) const fn filling(by: Claimant, victim: Option<Victim>) -> Self {
        let victim = match victim {
            Some(Victim { priority, replaced }) => {
                HAS_VICTIM | (priority.0 as u64) << VICTIM | if replaced { NEWER } else { 0 }
            }
            None => 0,
        };
        Self(FILLING << STATE | victim | (by.participant as u64) << PARTICIPANT | by.incarnation as u64)
    }

    pub(crate) const fn ready(priority: Priority, ticket: u64) -> Self {
        Self(READY << STATE | (priority.0 as u64) << PRIORITY | ticket & TICKET)
    }

    pub(crate) const fn state(self) -> State {
        match self.0 >> STATE {
            0 => State::Free,
            FILLING => State::Filling {
                by: Claimant { participant: (self.0 >> PARTICIPANT) as u16, incarnation: self.0 as u32 },
                victim: if self.0 & HAS_VICTIM == 0 {
                    None
                } else {
                    Some(Victim { priority: Priority((self.0 >> VICTIM) as u8), replaced: self.0 & NEWER != 0 })
                },
            },
            READY => State::Ready,
            _ => State::Taken,
        }
    }

    pub(crate) const fn is_ready(self) -> bool {
        self.0 >> STATE == READY
    }

    /// Ready becomes Taken.
    pub(crate) const fn taken(self) -> Self {
        Self(self.0 | TAKEN << STATE)
    }

    /// Taken becomes Ready a second time.
    pub(crate) const fn redelivered(self) -> Self {
        Self(self.0 & !(TAKEN << STATE) | READY << STATE | REDELIVERED)
    }

    /// Whether a ready or taken package may have been delivered before.
    pub(crate) const fn is_redelivered(self) -> bool {
        self.0 & REDELIVERED != 0
    }

    /// Priority of a ready or taken package.
    pub(crate) const fn priority(self) -> Priority {
        Priority((self.0 >> PRIORITY) as u8)
    }

    /// Place of a ready or taken package in the order of publishing.
    pub(crate) const fn ticket(self) -> u64 {
        self.0 & TICKET
    }

    /// Greater goes first: the more important, then the earlier.
    pub(crate) const fn rank(self) -> u64 {
        (self.priority().0 as u64) << RANK | (TICKET - self.ticket())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_goes_in_comes_out(
            participant: u16,
            incarnation: u32,
            victim: Option<(u8, bool)>,
            priority: u8,
            ticket in 0..=TICKET,
        ) {
            let by = Claimant { participant, incarnation };
            let victim = victim.map(|(priority, replaced)| Victim { priority: Priority(priority), replaced });
            prop_assert_eq!(Word::filling(by, victim).state(), State::Filling { by, victim });
            let ready = Word::ready(Priority(priority), ticket);
            for (word, state, redelivered) in [
                (ready, State::Ready, false),
                (ready.taken(), State::Taken, false),
                (ready.taken().redelivered(), State::Ready, true),
                (ready.taken().redelivered().taken(), State::Taken, true),
            ] {
                prop_assert_eq!(word.state(), state);
                prop_assert_eq!(word.is_redelivered(), redelivered);
                prop_assert_eq!((word.priority(), word.ticket()), (Priority(priority), ticket));
            }
        }

        #[test]
        fn the_more_important_then_the_earlier_goes_first(a: (u8, u32), b: (u8, u32)) {
            let rank = |(p, t): (u8, u32)| Word::ready(Priority(p), u64::from(t)).rank();
            prop_assert_eq!(rank(a) > rank(b), (a.0, std::cmp::Reverse(a.1)) > (b.0, std::cmp::Reverse(b.1)));
        }
    }
}
