//! Order: of one sender, one receiver and one priority nothing is delivered after something newer.
//!
//! A table with four places for each value of a hash. What has no place any more is remembered by its group's floor: nothing unknown at
//! or below it is delivered. So a full table costs packages that were overtaken, never the order.

use crate::broken::broken;
use rohrpost_mailbox::Head;

const GROUPS: usize = 64;
const PLACES: usize = 4;

/// Where a package stands among all of its peer's life: sequence of its first datagram, then its place in it.
pub(super) fn position(sequence: u64, index: u16) -> u64 {
    sequence << 16 | u64::from(index)
}

/// What was delivered last of each flow, for one peer.
#[derive(Debug)]
pub(super) struct Order {
    groups: Box<[Group; GROUPS]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Group {
    /// One more than the position delivered last; 0: empty.
    places: [(u64, Flow); PLACES],
    /// One more than the highest position that was forgotten.
    floor: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Flow {
    names: u64,
    priority: u8,
}

impl Order {
    /// Nothing delivered yet.
    pub(super) fn new() -> Self {
        Self { groups: Box::new([Group::default(); GROUPS]) }
    }

    /// Forgets all: a new life of the peer.
    pub(super) fn clear(&mut self) {
        self.groups.fill(Group::default());
    }

    /// Whether a package may be delivered: nothing newer of its flow was. Then it is the newest.
    pub(super) fn admit(&mut self, head: &Head, position: u64) -> bool {
        let names = u64::from(head.to.raw()) << 32 | u64::from(head.from.raw());
        let flow = Flow { names, priority: head.priority.0 };
        // The golden ratio spreads what names have in common.
        let spread = (names ^ u64::from(flow.priority) << 24).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let group = &mut self.groups[(spread >> 58) as usize % GROUPS];
        let mark = position + 1;
        if let Some((last, _)) = group.places.iter_mut().find(|(last, known)| *last != 0 && *known == flow) {
            let newer = mark > *last || broken!(TakesLate);
            *last = mark.max(*last);
            return newer;
        }
        if mark <= group.floor && !broken!(ForgetsFloor) {
            return false;
        }
        // The oldest gives way; an empty place is older than all.
        if let Some(oldest) = group.places.iter_mut().min_by_key(|(last, _)| *last) {
            group.floor = group.floor.max(oldest.0);
            *oldest = (mark, flow);
        }
        true
    }
}

impl Default for Order {
    fn default() -> Self {
        Self::new()
    }
}
