//! The router's mailbox as the thread of the time slots has it: [`intake`](crate::intake) says what to take when.

use crate::intake::Transit;
use crate::outbound::{Accepted, Outbound, Package};
use crate::report::Report;
use rohrpost_mailbox::{Head, Priority, Receiver, monotonic_ns};

/// What a package goes through when it is taken.
pub(super) struct TransitAdapter<'a, R, N> {
    pub(super) transit: &'a mut Receiver,
    pub(super) outbound: &'a mut Outbound,
    pub(super) report: &'a mut R,
    /// Says the local time, ns.
    pub(super) local_ns: N,
}

impl<R: Report, N: Fn() -> u64> Transit for TransitAdapter<'_, R, N> {
    fn waits(&mut self) -> (usize, Option<Priority>) {
        self.transit.waits()
    }

    fn slots(&self) -> usize {
        self.transit.shape().slots.into()
    }

    fn queued(&self) -> Option<u8> {
        self.outbound.first_level()
    }

    fn level(&self, priority: Priority) -> u8 {
        self.outbound.level(priority)
    }

    fn local_ns(&self) -> u64 {
        (self.local_ns)()
    }

    fn take(&mut self) -> Option<(Head, Accepted)> {
        let waiting = self.transit.try_receive()?;
        let head = *waiting.head();
        let package = Package { head, published_ns: waiting.published_ns(), body: waiting.body() };
        Some((head, self.outbound.accept(monotonic_ns(), &package, false, self.report)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Cause;
    use crate::harness::{End, S, TestNode, module};
    use crate::intake::{FEW, Intake, LEFT_NS_MIN, MAKING_NS, TAKING_NS, UNTAKEN_NS_MAX};
    use rohrpost_mailbox::{HEAD_BYTES, Label, Sender, Shape, Type};

    /// A package of this body takes 50 bytes of a slot.
    const BODY: [u8; 50 - HEAD_BYTES] = [7; 50 - HEAD_BYTES];
    const SLOTS: u16 = 16;

    /// A router of node 0, and a mailbox for packages to node 1.
    struct Ground {
        intake: Intake,
        transit: Receiver,
        sender: Sender,
        end: End,
        /// Time until the thread has to wake up.
        left_ns: u64,
        _node: TestNode,
    }

    impl Ground {
        /// That began so long ago.
        fn new(age_ns: u64) -> Self {
            let node = TestNode::new();
            let shape = Shape { slots: SLOTS, full: rohrpost_mailbox::OverflowPolicy::Displace, ..Shape::default() };
            let transit = node.join().receiver(module(100, 1), shape).unwrap();
            let sender = node.join().sender(module(100, 1)).unwrap();
            Self {
                intake: Intake::new(monotonic_ns()),
                transit,
                sender,
                end: End::begin(0, monotonic_ns() - age_ns, |_| {}),
                left_ns: u64::MAX,
                _node: node,
            }
        }

        fn send(&mut self, kind: Type, priorities: &[u8]) {
            for priority in priorities {
                let label = Label { from: module(100, 0), kind, priority: Priority(*priority), ..Label::default() };
                self.sender.send(&label, &[&BODY]).unwrap();
            }
        }

        fn data(&mut self, priorities: &[u8]) {
            self.send(Type::data(1), priorities);
        }

        fn open(&mut self, room_bytes: usize) {
            self.intake.open(monotonic_ns(), room_bytes);
        }

        fn hands(&mut self) -> (&mut Intake, impl Transit) {
            let Self { intake, transit, end, .. } = self;
            (intake, TransitAdapter { transit, outbound: &mut end.outbound, report: &mut end.log, local_ns: || 0 })
        }

        /// Looks this often shortly before the call.
        fn before_the_call(&mut self, looks: usize) {
            let (intake, mut hands) = self.hands();
            (0..looks).for_each(|_| _ = intake.take_one(&mut hands));
        }

        /// Before a datagram, while the wire is busy for long enough to take so many.
        fn in_the_slot(&mut self, busy_for: u64) {
            let left = std::cell::Cell::new(busy_for + 1);
            let busy_ns = |_| left.replace(left.get().saturating_sub(1)).min(2) * (TAKING_NS + MAKING_NS);
            let (intake, mut hands) = self.hands();
            intake.take_on(&mut hands, busy_ns);
        }

        fn between_slots(&mut self) {
            let wake_ns = self.left_ns;
            let (intake, mut hands) = self.hands();
            intake.relieve(monotonic_ns(), &mut hands, wake_ns);
        }

        /// Packages in the mailbox, and in the queue.
        fn waiting(&mut self) -> (usize, u64) {
            (self.transit.waits().0, self.end.stats.waiting_in_all())
        }
    }

    #[test]
    fn a_slot_takes_what_it_has_room_for_and_then_what_is_more_important() {
        let mut ground = Ground::new(0);
        ground.data(&[10, 90, 50, 50, 20]);
        ground.open(100);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (3, 2), "90 and 50 fill it");
        ground.data(&[50]);
        ground.before_the_call(10);
        ground.in_the_slot(9);
        assert_eq!(ground.waiting(), (4, 2), "as important as what was taken, it waits");
        ground.data(&[95, 51]);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (4, 4));
        ground.data(&[95; FEW + 2]);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (6, 8), "a few between two datagrams");
        ground.in_the_slot(9);
        assert_eq!(ground.waiting(), (4, 10));
        ground.open(10_000);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (4, 10), "what is less important takes no time from what is to leave");
        ground.data(&[200]);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (4, 11), "this one leaves next");
        ground.in_the_slot(9);
        assert_eq!(ground.waiting(), (0, 15), "what there is room for");
    }

    #[test]
    fn in_a_slot_what_is_less_important_is_taken_only_while_the_wire_is_busy() {
        let mut ground = Ground::new(0);
        ground.data(&[90; FEW + 2]);
        ground.data(&[50, 50]);
        ground.open(10_000);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (4, FEW as u64));
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (2, 6));
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (2, 6), "all that is to leave next is there");
        ground.in_the_slot(1);
        assert_eq!(ground.waiting(), (1, 7));
        // What hurries more than it may stands first in the mailbox, whatever waits in the queue.
        ground.send(Type::command(16), &[255; FEW + 2]);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (3, 7 + FEW as u64));
    }

    #[test]
    fn in_a_slot_a_mailbox_does_not_become_full_and_what_is_lost_does_not_end_it() {
        let mut ground = Ground::new(0);
        ground.open(50);
        ground.data(&[90; 1]);
        ground.before_the_call(1);
        ground.data(&[90; SLOTS as usize / 2]);
        ground.in_the_slot(9);
        assert_eq!(ground.waiting(), (8, 1), "no room, and no more important");
        ground.data(&[90; 2]);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (8, 3), "down to half of it");

        // Their peer is silent, so that taking them gives nothing to send.
        let mut ground = Ground::new(5 * S);
        ground.data(&[90; FEW + 2]);
        ground.open(1000);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (0, 0));
        assert_eq!(ground.end.log.lost.len(), FEW + 2);
    }

    #[test]
    fn what_comes_after_a_slot_that_was_not_full_waits_for_the_next() {
        let mut ground = Ground::new(0);
        ground.open(1000);
        ground.data(&[50]);
        ground.before_the_call(1);
        ground.intake.close();
        ground.data(&[50, 255]);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (2, 1));
    }

    #[test]
    fn between_slots_all_stays_unless_it_is_much_or_no_slot_comes() {
        let mut ground = Ground::new(0);
        ground.data(&[50; SLOTS as usize / 2]);
        ground.between_slots();
        assert_eq!(ground.waiting(), (8, 0));
        ground.data(&[50]);
        ground.left_ns = LEFT_NS_MIN;
        ground.between_slots();
        assert_eq!(ground.waiting(), (9, 0), "the slot is too near");
        ground.left_ns = u64::MAX;
        ground.between_slots();
        assert_eq!(ground.waiting(), (0, 9), "more than half");
        ground.data(&[50]);
        ground.between_slots();
        assert_eq!(ground.waiting(), (1, 9));
        ground.intake = Intake::new(monotonic_ns() - UNTAKEN_NS_MAX);
        ground.between_slots();
        assert_eq!(ground.waiting(), (0, 10), "no slot came for long");
    }

    #[test]
    fn what_hurries_more_than_it_may_takes_no_room_from_what_may() {
        let mut ground = Ground::new(0);
        ground.send(Type::command(16), &[200, 200, 100]);
        ground.open(50);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (0, 3));
        ground.send(Type::command(16), &[100]);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (1, 3), "now it is full");
    }

    #[test]
    fn packages_for_a_silent_node_are_lost_in_the_next_slot_and_keep_nothing_up() {
        let mut ground = Ground::new(10 * S);
        ground.data(&[50; 5]);
        ground.open(50);
        ground.in_the_slot(0);
        assert_eq!(ground.waiting(), (0, 0));
        assert_eq!(ground.end.log.causes(), [Cause::Silent; 5]);
    }
}
