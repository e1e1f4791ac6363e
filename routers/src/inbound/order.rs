//! Order: of one sender, one receiver and one priority nothing is delivered after something newer.
//!
//! A table with four places for each value of a hash. The group's floor stands for what has no place any more: nothing
//! unknown at or below it is delivered. So a full table costs reordered packages, never the order.
//!
//! A package in fragments takes the place of its first fragment, which may be far behind the floor when the last comes.
//! So it is checked when it begins, and [`Reassembly`](crate::fragment::Reassembly) notes whether a newer package of
//! its flow goes before it.

use crate::fragment::CompletePackage;
use rohrpost_mailbox::Head;

const GROUPS: usize = 64;
const PLACES: usize = 4;

/// Position of a package in its peer's incarnation: sequence of its first datagram, then its place in it.
pub(super) fn position(sequence: u64, index: u16) -> u64 {
    sequence << 16 | u64::from(index)
}

/// The sequence in a position.
pub(super) fn sequence_of(position: u64) -> u64 {
    position >> 16
}

/// The last delivered package of each flow, for one peer.
#[derive(Debug)]
pub(super) struct Order {
    groups: Box<[Group; GROUPS]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Group {
    /// One more than the last delivered position; 0: empty.
    places: [(u64, FlowKey); PLACES],
    /// One more than the highest forgotten position.
    floor: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct FlowKey {
    names: u64,
    priority: u8,
}

impl Order {
    /// Forgets all: a new incarnation of the peer.
    pub(super) fn clear(&mut self) {
        self.groups.fill(Group::default());
    }

    /// Whether a package may be delivered: nothing newer of its flow was. Then it is the newest.
    pub(super) fn admit(&mut self, head: &Head, position: u64) -> bool {
        let is_late = self.is_late(head, position);
        if !is_late {
            self.note(head, position);
        }
        !is_late
    }

    /// Whether a package that came in fragments is late; if it is not, it is the newest of its flow.
    pub(super) fn is_whole_late(&mut self, whole: &CompletePackage<'_>) -> bool {
        let position = position(whole.first, 0);
        let is_late = whole.is_late;
        if !is_late {
            self.note(&whole.head, position);
        }
        is_late
    }

    /// Whether something newer of its flow was delivered, or may have been.
    pub(super) fn is_late(&self, head: &Head, position: u64) -> bool {
        let (flow, group) = place(head);
        let (group, mark) = (&self.groups[group], position + 1);
        match group.places.iter().find(|(last, known)| *last != 0 && *known == flow) {
            Some((last, _)) => mark <= *last,
            None => mark <= group.floor,
        }
    }

    /// It is delivered, and no newer one of its flow was.
    pub(super) fn note(&mut self, head: &Head, position: u64) {
        let (flow, group) = place(head);
        let (group, mark) = (&mut self.groups[group], position + 1);
        if let Some((last, _)) = group.places.iter_mut().find(|(last, known)| *last != 0 && *known == flow) {
            *last = mark.max(*last);
            return;
        }
        // The oldest is replaced; an empty place is older than all.
        if let Some(oldest) = group.places.iter_mut().min_by_key(|(last, _)| *last) {
            group.floor = group.floor.max(oldest.0);
            *oldest = (mark, flow);
        }
    }
}

/// The flow of a package, and its group.
fn place(head: &Head) -> (FlowKey, usize) {
    let names = u64::from(head.to.raw()) << 32 | u64::from(head.from.raw());
    let flow = FlowKey { names, priority: head.priority.0 };
    // The golden ratio spreads names that have bits in common.
    let spread = (names ^ u64::from(flow.priority) << 24).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (flow, (spread >> 58) as usize % GROUPS)
}

impl Default for Order {
    /// Nothing delivered yet.
    fn default() -> Self {
        Self { groups: Box::new([Group::default(); GROUPS]) }
    }
}
