//! Packages that wait for the wire: 32 levels, and a quota for each sender.
//!
//! ```text
//!  level 0 … 31 of each peer   first ─▶ package ─▶ package      first in, first out
//!  level 0 … 31 of each sender first ─▶ package ─▶ package      beyond its quota: loses its lowest, newest
//!  package                     head · block ─▶ block ─▶ block   256 B each: no large hole needed
//! ```
//!
//! If only the newest value of some data counts, a newer package can [`replace`](Queue::replace) a waiting one in its
//! place, provided that the queue was made [for that](Queue::shared).
//!
//! All memory is taken at the start. Each sender's quota is reserved, so no sender can use up another's. In a queue
//! that is [shared](Queue::shared) all use one memory, and the sender that uses most of it loses packages first.

mod blocks;
mod hints;
mod list;
mod shares;

use crate::frame::NodeIndex;
use blocks::{BLOCK_BYTES, Blocks, Chain};
use hints::Hints;
use list::{List, Lists};
use rohrpost_mailbox::{Head, Kind, Options};
use rohrpost_network::{LEVELS, NODES_MAX};
pub use shares::QueueShare;
use shares::Shares;

const _: () = assert!(NODES_MAX <= 64, "a level's peers are the bits of a word");

/// A package that waits, without its body.
#[derive(Clone, Copy, Debug, Default)]
pub struct QueuedPackage {
    /// Its head, as it leaves.
    pub head: Head,
    /// When its sender published it, ns.
    pub published_ns: u64,
    /// Receiver.
    pub peer: NodeIndex,
    /// The sender for its quota.
    pub sender: u16,
    /// Its sender and party in a shared queue.
    pub share: QueueShare,
    /// Its level; 0 goes first.
    pub level: u8,
    /// How often it was forwarded, where that counts.
    pub hops: u8,
    /// Sequence of the first fragment, if some have left.
    pub first: u64,
    /// How many fragments have left.
    pub fragments: u16,
}

#[derive(Clone, Copy, Debug, Default)]
struct QueueEntry {
    waiting: QueuedPackage,
    ticket: u64,
    body: Chain,
}

/// A place in the queue; valid until its package is taken out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place(u32);

/// The packages that wait.
#[derive(Debug)]
pub struct Queue {
    entries: Box<[QueueEntry]>,
    blocks: Blocks,
    /// Links of both kinds of lists. A free entry is in `free`, through its peer's links.
    by_peer: Lists,
    by_sender: Lists,
    free: List,
    peers: Box<[[List; LEVELS]]>,
    /// Levels on which something waits for a peer, one bit each.
    waiting_for: Box<[u32]>,
    senders: Vec<Sender>,
    /// The senders, and their use of the line; none: each has a quota of its own.
    shares: Option<Shares>,
    /// Peers with something on a level, one bit each.
    busy: [u64; LEVELS],
    /// Levels with something, one bit each.
    levels: u32,
    /// Where packages wait of which only the newest counts.
    hints: Option<Hints>,
    quota_blocks: u32,
    ticket: u64,
    used_blocks: u32,
    len: usize,
}

/// Whether only the newest of such packages counts.
pub fn counts_newest(head: &Head) -> bool {
    let is_data = matches!(head.kind.kind(), Kind::Data(_));
    is_data && head.options.has(Options::NEWEST)
}

#[derive(Clone, Debug, Default)]
struct Sender {
    levels: [List; LEVELS],
    /// Blocks that may be displaced, by level.
    blocks: [u32; LEVELS],
    /// Levels with something that may be displaced, one bit each.
    waiting: u32,
    /// Blocks in all.
    used: u32,
}

impl Queue {
    /// A queue for this many senders and nodes. `quota_bytes` is what each sender may have waiting.
    pub fn new(senders: usize, nodes: usize, quota_bytes: usize) -> Self {
        let quota_blocks = quota_bytes.div_ceil(BLOCK_BYTES);
        let count = quota_blocks * senders;
        let mut queue = Self {
            entries: vec![QueueEntry::default(); count].into(),
            blocks: Blocks::new(count),
            by_peer: Lists::new(count),
            by_sender: Lists::new(count),
            free: List::default(),
            peers: vec![[List::default(); LEVELS]; nodes].into(),
            waiting_for: vec![0; nodes].into(),
            senders: vec![Sender::default(); senders],
            shares: None,
            busy: [0; LEVELS],
            levels: 0,
            hints: None,
            quota_blocks: quota_blocks as u32,
            ticket: 0,
            used_blocks: 0,
            len: 0,
        };
        for place in 0..count as u32 {
            queue.by_peer.append(&mut queue.free, place);
        }
        queue
    }

    /// For one peer and any number of senders, which [share](Queue::sender_of) the quota; it finds what a newer package
    /// replaces.
    pub fn shared(quota_bytes: usize) -> Self {
        let mut queue = Self::new(1, 1, quota_bytes);
        queue.senders.clear();
        Self { hints: Some(Hints::new(queue.entries.len())), shares: Some(Shares::default()), ..queue }
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.levels == 0
    }

    /// Packages that wait.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Bytes of memory in use.
    pub fn used_bytes(&self) -> u64 {
        u64::from(self.used_blocks) * BLOCK_BYTES as u64
    }

    /// Bytes of memory in use for a sender.
    pub fn used_by(&self, sender: u16) -> u64 {
        self.senders.get(usize::from(sender)).map_or(0, |sender| u64::from(sender.used) * BLOCK_BYTES as u64)
    }

    /// Queues a package. Displaced packages are handed to `gone`. If nothing less important of the same sender can make
    /// room, the package itself is not taken.
    #[must_use]
    pub fn push(&mut self, waiting: QueuedPackage, body: &[u8], mut gone: impl FnMut(&QueuedPackage, &[u8])) -> bool {
        let needed = Blocks::needed(body.len());
        if !self.evict(usize::from(waiting.sender), waiting.level, needed, &mut gone) {
            return false;
        }
        // A package has at least one block, and there are as many places as blocks.
        let Some(place) = self.by_peer.take_first(&mut self.free) else { return false };
        let body = self.blocks.store(body);
        self.entries[place as usize] = QueueEntry { waiting, ticket: self.ticket, body };
        if let Some(hints) = self.hints.as_mut().filter(|_| counts_newest(&waiting.head)) {
            hints.note(&waiting.head, place, |hint| self.entries[hint as usize].of_newest());
        }
        self.ticket += 1;
        self.used_blocks += needed;
        self.len += 1;
        let (peer, level) = (usize::from(waiting.peer), usize::from(waiting.level));
        self.by_peer.append(&mut self.peers[peer][level], place);
        self.busy[level] |= 1 << peer;
        self.waiting_for[peer] |= 1 << level;
        self.levels |= 1 << level;
        let sender = &mut self.senders[usize::from(waiting.sender)];
        if let Some(shares) = self.shares.as_mut().filter(|_| sender.used == 0) {
            shares.begins(waiting.sender);
        }
        self.by_sender.append(&mut sender.levels[level], place);
        sender.waiting |= 1 << level;
        sender.blocks[level] += needed;
        sender.used += needed;
        true
    }

    /// The waiting package that this one replaces: both are of the same state, no fragment of it has left, and only the
    /// newest of such packages counts.
    pub fn older(&self, newer: &QueuedPackage) -> Option<Place> {
        let hints = self.hints.as_ref().filter(|_| counts_newest(&newer.head))?;
        let is_older = |place: &u32| {
            let QueueEntry { waiting, .. } = &self.entries[*place as usize];
            let is_alike = (waiting.sender, waiting.peer, waiting.level) == (newer.sender, newer.peer, newer.level);
            is_alike
                && waiting.fragments == 0
                && self.entries[*place as usize].of_newest().is_some_and(|head| same_state(head, &newer.head))
        };
        hints.of(&newer.head).find(is_older).map(Place)
    }

    /// Queues a package in the place of the [older](Self::older) one. False: it has no room, even if less important
    /// ones are displaced; then the older one stays.
    #[must_use]
    pub fn replace(
        &mut self,
        place: Place,
        newer: QueuedPackage,
        body: &[u8],
        mut gone: impl FnMut(&QueuedPackage, &[u8]),
    ) -> bool {
        let QueueEntry { body: old, .. } = self.entries[place.0 as usize];
        let needed = Blocks::needed(body.len());
        let (sender, level) = (usize::from(newer.sender), newer.level);
        if !self.evict(sender, level, needed.saturating_sub(old.blocks()), &mut gone) {
            return false;
        }
        self.blocks.free(old);
        let QueueEntry { waiting, body: stored, .. } = &mut self.entries[place.0 as usize];
        (*waiting, *stored) = (newer, self.blocks.store(body));
        let changed = |blocks: u32| blocks + needed - old.blocks();
        let sender = &mut self.senders[sender];
        sender.blocks[usize::from(level)] = changed(sender.blocks[usize::from(level)]);
        sender.used = changed(sender.used);
        self.used_blocks = changed(self.used_blocks);
        true
    }

    fn evict(&mut self, sender: usize, level: u8, needed: u32, gone: &mut impl FnMut(&QueuedPackage, &[u8])) -> bool {
        if self.shares.is_some() {
            return self.evict_shared(sender, level, needed, gone);
        }
        let own = &self.senders[sender];
        let lower = usize::from(level) + 1;
        let yielding: u32 = own.blocks[lower..].iter().sum();
        let quota = self.quota_blocks;
        if own.used - yielding + needed > quota {
            return false;
        }
        while self.senders[sender].used + needed > quota {
            // There is one: displaceable packages were counted.
            if !self.displace(sender, lower, gone) {
                return false;
            }
        }
        true
    }

    /// Displaces the newest package of a sender's least important level, from `lower` on; false: there is none.
    fn displace(&mut self, sender: usize, lower: usize, gone: &mut impl FnMut(&QueuedPackage, &[u8])) -> bool {
        let Some(last) = self.senders[sender].levels[lower..].iter().rev().find_map(List::last) else { return false };
        let (waiting, beginning) = self.remove(Place(last));
        gone(&waiting, beginning);
        true
    }

    /// The next package: of the first level, the one that has waited longest.
    pub fn first(&self) -> Option<Place> {
        self.first_among(u64::MAX)
    }

    /// The first package of those for these peers, one bit each.
    pub fn first_among(&self, peers: u64) -> Option<Place> {
        if self.levels == 0 {
            return None;
        }
        let level = bits(self.levels.into()).find(|level| self.busy[*level] & peers != 0)?;
        let firsts = bits(self.busy[level] & peers).filter_map(|peer| self.peers[peer][level].first());
        firsts.min_by_key(|place| self.entries[*place as usize].ticket).map(Place)
    }

    /// The first package for a peer on a level, if any.
    pub fn first_of(&self, peer: NodeIndex, level: u8) -> Option<Place> {
        let list = &self.peers[usize::from(peer)][usize::from(level)];
        list.first().map(Place)
    }

    /// The next package behind another, for the same peer and on the same level.
    pub fn behind(&self, place: Place) -> Option<Place> {
        self.by_peer.after(place.0).map(Place)
    }

    /// The first level, from this one on, on which something waits for a peer.
    pub fn next_level(&self, peer: NodeIndex, from: u8) -> Option<u8> {
        let levels = self.waiting_for[usize::from(peer)] & u32::MAX.checked_shl(from.into()).unwrap_or(0);
        (levels != 0).then(|| levels.trailing_zeros() as u8)
    }

    /// The first level on which something waits for others than this peer.
    pub fn first_level_besides(&self, peer: NodeIndex) -> Option<u8> {
        let others = |level: &usize| self.busy[*level] & !(1 << peer) != 0;
        bits(self.levels.into()).find(others).map(|level| level as u8)
    }

    /// The package at a place.
    pub fn at(&self, place: Place) -> &QueuedPackage {
        &self.entries[place.0 as usize].waiting
    }

    /// Copies the next bytes of a package's body out.
    pub fn read(&mut self, place: Place, into: &mut [u8]) {
        self.blocks.read(&mut self.entries[place.0 as usize].body, into);
    }

    /// A fragment has left: the package cannot be displaced any more.
    pub fn part_left(&mut self, place: Place, first: u64) {
        let entry = &mut self.entries[place.0 as usize];
        entry.waiting.fragments += 1;
        if entry.waiting.fragments == 1 {
            entry.waiting.first = first;
            let (sender, level) = (usize::from(entry.waiting.sender), usize::from(entry.waiting.level));
            let sender = &mut self.senders[sender];
            sender.blocks[level] -= entry.body.blocks();
            self.by_sender.remove(&mut sender.levels[level], place.0);
            sender.emptied(level);
        }
    }

    /// Takes a package out, and returns it with the beginning of its body.
    pub fn remove(&mut self, place: Place) -> (QueuedPackage, &[u8]) {
        let QueueEntry { waiting, body, .. } = self.entries[place.0 as usize];
        let (peer, level) = (usize::from(waiting.peer), usize::from(waiting.level));
        self.by_peer.remove(&mut self.peers[peer][level], place.0);
        if self.peers[peer][level].first().is_none() {
            self.busy[level] &= !(1 << peer);
            self.waiting_for[peer] &= !(1 << level);
            if self.busy[level] == 0 {
                self.levels &= !(1 << level);
            }
        }
        let sender = &mut self.senders[usize::from(waiting.sender)];
        if waiting.fragments == 0 {
            self.by_sender.remove(&mut sender.levels[level], place.0);
            sender.emptied(level);
            sender.blocks[level] -= body.blocks();
        }
        sender.used -= body.blocks();
        if let Some(shares) = self.shares.as_mut().filter(|_| sender.used == 0) {
            shares.ends(waiting.sender);
        }
        self.used_blocks -= body.blocks();
        self.len -= 1;
        self.entries[place.0 as usize].body = Chain::default();
        self.blocks.free(body);
        self.by_peer.prepend(&mut self.free, place.0);
        (waiting, self.blocks.beginning(&body, waiting.head.len))
    }
}

impl Sender {
    /// A package was taken from a level.
    fn emptied(&mut self, level: usize) {
        if self.levels[level].first().is_none() {
            self.waiting &= !(1 << level);
        }
    }
}

impl QueueEntry {
    /// Its head, if only the newest of such packages counts.
    fn of_newest(&self) -> Option<&Head> {
        (self.body.blocks() > 0 && counts_newest(&self.waiting.head)).then_some(&self.waiting.head)
    }
}

/// Whether two packages are values of the same state, one earlier and the other later.
fn same_state(one: &Head, other: &Head) -> bool {
    (one.to, one.from, one.kind, one.id) == (other.to, other.from, other.kind, other.id)
}

fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(bit)
    })
}

#[cfg(test)]
mod tests;
