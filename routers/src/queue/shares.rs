//! Shares of one memory and one line, for senders that do not trust each other: each gets an equal part where there is
//! not enough.
//!
//! ```text
//!  memory   when full, the sender that uses most loses its least important and newest package; a sender that uses no
//!           more than others loses nothing to them
//!  line     the most important goes first, among parties that are at most a window ahead of the one that was served
//!           least; senders that trust each other are one party, within which only importance counts
//! ```

use super::{Place, Queue, QueuedPackage, Sender};

/// Bytes of a package on the line besides its body, about.
const HEADS_BYTES: u64 = 32;

/// The sender and the party of a package.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct QueueShare {
    /// The sender, for memory.
    pub sender: u32,
    /// Its party, for the line.
    pub party: u32,
}

/// The senders' places, and how much each party was served.
#[derive(Debug, Default)]
pub(super) struct Shares {
    /// By the sender's place: its number, and the place of its party.
    senders: Vec<(u32, usize)>,
    parties: Vec<Party>,
}

#[derive(Debug)]
struct Party {
    number: u32,
    /// Bytes of the line. A party begins with the amount of the party that was served least.
    served: u64,
    /// Its senders with something waiting.
    waiting: u32,
}

impl Shares {
    /// The least served amount among parties with something waiting.
    fn least_served(&self) -> Option<u64> {
        self.parties.iter().filter(|party| party.waiting > 0).map(|party| party.served).min()
    }

    /// The place of a party; a new or a free one, if it has none.
    fn party(&mut self, number: u32) -> usize {
        if let Some(at) = self.parties.iter().position(|party| party.number == number) {
            return at;
        }
        // A party that was served more than others is remembered until they have caught up.
        let least = self.least_served().unwrap_or(u64::MAX);
        let fresh = Party { number, served: 0, waiting: 0 };
        match self.parties.iter().position(|party| party.waiting == 0 && party.served <= least) {
            Some(at) => {
                self.parties[at] = fresh;
                at
            }
            None => {
                self.parties.push(fresh);
                self.parties.len() - 1
            }
        }
    }

    /// Something of a sender waits from now on; nothing did before. No party saves up credit.
    pub(super) fn begins(&mut self, sender: u16) {
        let least = self.least_served();
        if least.is_none() {
            // A party that is alone waits for no other.
            self.parties.iter_mut().for_each(|party| party.served = 0);
        }
        let party = &mut self.parties[self.senders[usize::from(sender)].1];
        party.served = party.served.max(least.unwrap_or(0));
        party.waiting += 1;
    }

    /// Nothing of a sender waits any more.
    pub(super) fn ends(&mut self, sender: u16) {
        self.parties[self.senders[usize::from(sender)].1].waiting -= 1;
    }
}

impl Queue {
    /// The place of a sender; a free or a new one, if it has none. So there are at most as many as packages wait, and
    /// one.
    pub fn sender_of(&mut self, share: QueueShare) -> u16 {
        let number = share.sender;
        let Some(shares) = &mut self.shares else { return 0 };
        let is_known = |(_, (known, _)): &(&Sender, &(u32, usize))| *known == number;
        let known = self.senders.iter().zip(&shares.senders).position(|both| is_known(&both));
        let idle = || self.senders.iter().position(|sender| sender.used == 0);
        let at = known.or_else(idle).unwrap_or_else(|| {
            self.senders.push(Sender::default());
            shares.senders.push((number, 0));
            self.senders.len() - 1
        });
        if self.senders[at].used == 0 {
            shares.senders[at] = (number, shares.party(share.party));
        }
        at as u16
    }

    /// Whether packages of other senders wait.
    pub fn others_wait(&self, sender: u16) -> bool {
        self.used_blocks > self.senders.get(usize::from(sender)).map_or(0, |sender| sender.used)
    }

    /// The next package: the most important of those parties that were served at most this many bytes more than the
    /// least served one.
    pub fn first_shared(&self, window_bytes: u64) -> Option<Place> {
        let shares = self.shares.as_ref();
        let Some((shares, least)) = shares.and_then(|shares| Some((shares, shares.least_served()?))) else {
            return self.first();
        };
        let is_in_turn = |at: usize| shares.parties[shares.senders[at].1].served - least <= window_bytes;
        let waiting = self.senders.iter().enumerate().filter(|(at, sender)| sender.waiting != 0 && is_in_turn(*at));
        let firsts = waiting.filter_map(|(_, sender)| {
            let level = sender.waiting.trailing_zeros() as usize;
            sender.levels[level].first().map(|place| (level, self.entries[place as usize].ticket, place))
        });
        firsts.min().map(|(_, _, place)| Place(place))
    }

    /// Takes out a package that leaves.
    pub fn serve(&mut self, place: Place) -> (QueuedPackage, &[u8]) {
        let QueuedPackage { sender, head, .. } = self.entries[place.0 as usize].waiting;
        if let Some(shares) = &mut self.shares {
            let party = shares.senders[usize::from(sender)].1;
            shares.parties[party].served += u64::from(head.len) + HEADS_BYTES;
        }
        self.remove(place)
    }

    /// Makes room where all use one memory: from the sender that uses more than this one would, then from this one
    /// itself.
    pub(super) fn evict_shared(
        &mut self,
        sender: usize,
        level: u8,
        needed: u32,
        gone: &mut impl FnMut(&QueuedPackage, &[u8]),
    ) -> bool {
        let (quota, lower) = (self.quota_blocks, usize::from(level) + 1);
        let own = self.senders[sender].used + needed;
        let short = (self.used_blocks + needed).saturating_sub(quota);
        if short == 0 {
            return true;
        }
        let others = self.senders.iter().enumerate().filter(|(at, _)| *at != sender);
        let beyond: u32 = others.map(|(_, other)| other.used.saturating_sub(own)).sum();
        let yielding: u32 = self.senders[sender].blocks[lower..].iter().sum();
        if short > beyond + yielding {
            return false;
        }
        while self.used_blocks + needed > quota {
            let others = self.senders.iter().enumerate().filter(|(at, other)| *at != sender && other.used > own);
            let largest = others.max_by_key(|(_, other)| other.used).map(|(at, _)| at);
            let is_made = match largest {
                Some(largest) => self.displace(largest, 0, gone),
                None => self.displace(sender, lower, gone),
            };
            // There is something to displace: it was counted.
            if !is_made {
                return false;
            }
        }
        true
    }
}
