//! Reassembly of packages that do not fit in a datagram, bounded in memory and time.
//!
//! A sender has at most one package in progress for each level and peer, and a more urgent one may go between. So
//! several are reassembled at a time. More than there is room for means that fragments were lost: the least important,
//! then oldest, is given up.

use crate::frame::{Fragment, PARTS_MAX};
use rohrpost_mailbox::Head;

/// Packages of one peer in reassembly at a time.
pub const PARTIAL_MAX: usize = 8;
/// A package without a further fragment for this long is given up.
pub const PATIENCE_NS: u64 = 1_000_000_000;
/// Remembered packages that were given up, so that a late fragment does not begin them again.
const GIVEN_UP_KEPT: usize = 8;

/// Events of a package that arrives in fragments.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Change {
    /// Its first fragment came, in any order.
    Began,
    /// It will not be complete.
    GivenUp,
}

/// A complete package.
#[derive(Debug)]
pub struct CompletePackage<'a> {
    /// Its head.
    pub head: Head,
    /// Sequence of the datagram with its first fragment: its place in the order.
    pub first: u64,
    /// A newer package of its flow was delivered before it.
    pub is_late: bool,
    /// Its body.
    pub body: &'a [u8],
}

/// The incomplete packages of one peer. Takes memory for each when first needed, and keeps it.
#[derive(Debug, Default)]
pub struct Reassembly {
    partial: Vec<Partial>,
    given_up: [Option<u64>; GIVEN_UP_KEPT],
    given_up_next: usize,
}

#[derive(Debug)]
struct Partial {
    is_used: bool,
    head: Head,
    first: u64,
    part_bytes: usize,
    count: u16,
    /// Fragments that came, one bit each.
    came: [u64; PARTS_MAX as usize / 64],
    missing: u16,
    touched_ns: u64,
    /// A newer package of its flow was delivered.
    is_late: bool,
    body: Vec<u8>,
}

impl Reassembly {
    /// Takes a fragment; returns the package if it was the last missing one. A fragment that contradicts the others is
    /// dropped. `is_late` is called when a package begins: whether a newer one of its flow was delivered before.
    pub fn take(
        &mut self,
        now_ns: u64,
        part: &Fragment<'_>,
        is_late: impl FnOnce() -> bool,
        mut tell: impl FnMut(&Head, &[u8], Change),
    ) -> Option<CompletePackage<'_>> {
        let is_its = |partial: &Partial| partial.first == part.first;
        let known = self.partial.iter().position(|partial| partial.is_used && is_its(partial));
        let at = match known {
            Some(at) => at,
            None if self.given_up.contains(&Some(part.first)) => return None,
            None => {
                tell(&part.head, &[], Change::Began);
                let at = self.room_for(part, &mut tell)?;
                self.partial[at].begin(part, is_late());
                at
            }
        };
        let partial = &mut self.partial[at];
        if !partial.add(now_ns, part) {
            return None;
        }
        partial.is_used = false;
        let Partial { head, first, is_late, .. } = *partial;
        if !is_late {
            self.delivers(&head, first);
        }
        Some(CompletePackage { head, first, is_late, body: &self.partial[at].body })
    }

    /// A package of the datagram with this sequence is delivered: incomplete packages of its flow that began before it
    /// are late now.
    pub fn delivers(&mut self, newer: &Head, sequence: u64) {
        let flow = |head: &Head| (head.to, head.from, head.priority);
        for older in self.partial.iter_mut().filter(|older| older.is_used && older.first < sequence) {
            older.is_late |= flow(&older.head) == flow(newer);
        }
    }

    /// Gives up packages without a fragment for too long.
    pub fn expire(&mut self, now_ns: u64, mut tell: impl FnMut(&Head, &[u8], Change)) {
        for at in 0..self.partial.len() {
            let partial = &self.partial[at];
            if partial.is_used && now_ns.saturating_sub(partial.touched_ns) >= PATIENCE_NS {
                self.give_up(at, &mut tell);
            }
        }
    }

    /// Gives up all: their sender is dead.
    pub fn clear(&mut self, mut tell: impl FnMut(&Head, &[u8], Change)) {
        for at in 0..self.partial.len() {
            if self.partial[at].is_used {
                self.give_up(at, &mut tell);
            }
        }
        // Sequences begin anew.
        self.given_up = [None; GIVEN_UP_KEPT];
    }

    /// Packages in reassembly.
    pub fn len(&self) -> usize {
        self.partial.iter().filter(|partial| partial.is_used).count()
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A place for another package, perhaps at the cost of one; none if it is itself the least important.
    fn room_for(&mut self, part: &Fragment<'_>, tell: &mut impl FnMut(&Head, &[u8], Change)) -> Option<usize> {
        if let Some(free) = self.partial.iter().position(|partial| !partial.is_used) {
            return Some(free);
        }
        if self.partial.len() < PARTIAL_MAX {
            self.partial.push(Partial::new());
            return Some(self.partial.len() - 1);
        }
        let worth = |at: &usize| (self.partial[*at].head.priority.0, self.partial[*at].first);
        let least = (0..self.partial.len()).min_by_key(worth)?;
        if (part.head.priority.0, part.first) < worth(&least) {
            self.remember_given_up(part.first);
            tell(&part.head, part.beginning(), Change::GivenUp);
            return None;
        }
        self.give_up(least, tell);
        Some(least)
    }

    fn give_up(&mut self, at: usize, tell: &mut impl FnMut(&Head, &[u8], Change)) {
        self.partial[at].is_used = false;
        self.remember_given_up(self.partial[at].first);
        let partial = &self.partial[at];
        let beginning = if partial.came[0] & 1 != 0 { &partial.body[..partial.part_bytes] } else { &[] };
        tell(&partial.head, beginning, Change::GivenUp);
    }

    fn remember_given_up(&mut self, first: u64) {
        self.given_up[self.given_up_next % GIVEN_UP_KEPT] = Some(first);
        self.given_up_next += 1;
    }
}

impl Partial {
    fn new() -> Self {
        Self {
            is_used: false,
            head: Head::default(),
            first: 0,
            part_bytes: 0,
            count: 0,
            came: [0; PARTS_MAX as usize / 64],
            missing: 0,
            touched_ns: 0,
            is_late: false,
            body: Vec::with_capacity(usize::from(u16::MAX)),
        }
    }

    fn begin(&mut self, part: &Fragment<'_>, is_late: bool) {
        let Fragment { first, count, head, .. } = *part;
        let mut body = std::mem::take(&mut self.body);
        // Bytes that are not overwritten are not handed out: see `Fragment::is_sound`.
        body.resize(head.len.into(), 0);
        let came = [0; PARTS_MAX as usize / 64];
        *self = Self {
            is_used: true,
            head,
            first,
            part_bytes: part.part_bytes(),
            count,
            came,
            missing: count,
            touched_ns: 0,
            is_late,
            body,
        };
    }

    /// Whether the package is complete now.
    fn add(&mut self, now_ns: u64, part: &Fragment<'_>) -> bool {
        let agrees = part.head == self.head && part.count == self.count && part.part_bytes() == self.part_bytes;
        let (word, bit) = (usize::from(part.index) / 64, 1 << (part.index % 64));
        if !agrees || self.came[word] & bit != 0 {
            return false;
        }
        self.came[word] |= bit;
        self.missing -= 1;
        self.touched_ns = now_ns;
        let start = part.offset as usize;
        self.body[start..start + part.bytes.len()].copy_from_slice(part.bytes);
        self.missing == 0
    }
}

#[cfg(test)]
mod tests;
