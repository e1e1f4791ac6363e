//! Where the newest package of each state waits: of one sender, receiver, type and id.
//!
//! A hint may be out of date: the caller checks the place. So nothing has to be removed when a package leaves. A lookup
//! costs the same however much waits. When more states meet than a set has room for, one is not found, and its next
//! package waits behind the one before.

use rohrpost_mailbox::Head;

/// Hints in one set.
const WAYS: usize = 4;
/// Sets, at most: no connection has more states waiting at a time.
const SETS_MAX: usize = 256;
const NONE: u32 = u32::MAX;

#[derive(Debug)]
pub(super) struct Hints(Box<[[u32; WAYS]]>);

impl Hints {
    /// Hints for a queue with this many places.
    pub(super) fn new(places: usize) -> Self {
        let sets = places.div_ceil(WAYS).next_power_of_two().min(SETS_MAX);
        Self(vec![[NONE; WAYS]; sets].into())
    }

    /// Places in which a package of this state may wait.
    pub(super) fn of(&self, head: &Head) -> impl Iterator<Item = u32> {
        self.0[self.set(head)].into_iter().filter(|place| *place != NONE)
    }

    /// A package waits there. `newest` returns the head of a waiting package if only the newest of it counts.
    pub(super) fn note<'a>(&mut self, head: &Head, place: u32, newest: impl Fn(u32) -> Option<&'a Head>) {
        let set = self.set(head);
        let is_dated =
            |hint: u32| hint == NONE || hint == place || newest(hint).is_none_or(|head| self.set(head) != set);
        let way = self.0[set].iter().position(|hint| is_dated(*hint)).unwrap_or(place as usize % WAYS);
        self.0[set][way] = place;
    }

    fn set(&self, head: &Head) -> usize {
        let names = u64::from(head.to.raw()) << 32 | u64::from(head.from.raw());
        let state = u64::from(head.kind.0.cast_unsigned()) << 16 | u64::from(head.id);
        // Odd factors with many bits spread inputs that differ in few; the upper half is spread best.
        let mixed = (names ^ state.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        (mixed >> 32) as usize & (self.0.len() - 1)
    }
}
