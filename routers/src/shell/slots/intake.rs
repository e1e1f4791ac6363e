//! What the thread of the time slots takes from the router's mailbox, and when.
//!
//! ```text
//!  between slots                             shortly before the call              in the slot, a few before each datagram
//!  all stays in the mailbox; if that has     as much as the slot has room for,    what still has room, or is more important
//!  more than half of its slots full: ─▶      the most important first: ─▶         than what was taken, or too much: ─▶   queue
//! ```
//!
//! The mailbox outlives a router that is killed, the queue does not: so what waits for a slot waits in the mailbox. A flood is taken out of it,
//! since quotas hold in the queue. So is all, if no slot came for long: what cannot leave must be told so to its sender.

use crate::outbound::{Accepted, Outbound, Package};
use crate::report::Report;
use rohrpost_mailbox::{HEAD_BYTES, Head, Kind, Priority, Receiver, monotonic_ns};

/// If no slot came for so long, what waits is taken: whether its peer is there, and whether it is too old, is found in the queue. A third of
/// the time after which packages are dropped.
const UNTAKEN_NS_MAX: u64 = crate::outbound::WAIT_MAX_NS / 3;
/// Packages taken at a time: all that the mailbox may hold.
const BURST: usize = 64;
/// Before each datagram of a slot at most so many, since it is to be handed over at once: the rest has its turn before the next. Bounds
/// count on one only, for they give each package a datagram of its own.
const FEW: usize = 4;
/// Nothing more is taken between slots with less than this until the thread has to wake up: to take one lasts for some ten microseconds.
const LEFT_NS_MIN: u64 = 50_000;

/// The router's mailbox, and what the coming slot still wants of it.
pub(super) struct Intake {
    transit: Receiver,
    /// What was taken for the slot leaves room for so many bytes.
    room_bytes: usize,
    /// The least important of what was taken for the slot.
    least: Priority,
    /// When there was a slot, or all was taken, ns.
    taken_ns: u64,
}

impl Intake {
    pub(super) fn new(transit: Receiver) -> Self {
        Self { transit, room_bytes: 0, least: Priority(u8::MAX), taken_ns: monotonic_ns() }
    }

    /// A slot comes that carries at most so many bytes.
    pub(super) fn open(&mut self, room_bytes: usize) {
        (self.room_bytes, self.least, self.taken_ns) = (room_bytes, Priority(u8::MAX), monotonic_ns());
    }

    /// It is over: what waits now waits for the next.
    pub(super) fn close(&mut self) {
        (self.room_bytes, self.least) = (0, Priority(u8::MAX));
    }

    /// Before the call: takes the next package, if the slot wants it.
    pub(super) fn take_one(&mut self, outbound: &mut Outbound, report: &mut impl Report) {
        if self.room_bytes > 0 || self.outranks() {
            self.take(outbound, report);
        }
    }

    /// In the slot, before each datagram: takes a few, and more only while there is nothing to send.
    pub(super) fn take_on(&mut self, outbound: &mut Outbound, report: &mut impl Report) {
        for taken in 0..BURST {
            let has_enough = taken >= FEW && outbound.waits();
            let wants = self.room_bytes > 0 || self.outranks() || self.is_full();
            if has_enough || !wants || !self.take(outbound, report) {
                return;
            }
        }
    }

    /// Between slots: takes all if it is much, or if there was no slot for long. `left_ns` says how long it may last.
    pub(super) fn relieve(
        &mut self,
        outbound: &mut Outbound,
        report: &mut impl Report,
        mut left_ns: impl FnMut() -> u64,
    ) {
        let now_ns = monotonic_ns();
        if self.is_full() || now_ns.saturating_sub(self.taken_ns) > UNTAKEN_NS_MAX {
            self.taken_ns = now_ns;
            let mut taken = 0;
            while taken < BURST && left_ns() > LEFT_NS_MIN && self.take(outbound, report) {
                taken += 1;
            }
        }
    }

    /// Whether the mailbox may have no room for a burst soon.
    fn is_full(&mut self) -> bool {
        2 * self.transit.waits().0 > usize::from(self.transit.shape().slots)
    }

    /// Whether something waits that is more important than what was taken.
    fn outranks(&mut self) -> bool {
        self.transit.waits().1.is_some_and(|first| first.outranks(self.least))
    }

    /// Takes the most important package; whether there was one.
    fn take(&mut self, outbound: &mut Outbound, report: &mut impl Report) -> bool {
        let Some(waiting) = self.transit.try_receive() else { return false };
        let head = *waiting.head();
        let package = Package { head, published_ns: waiting.published_ns(), body: waiting.body() };
        let accepted = outbound.accept(monotonic_ns(), &package, false, report);
        drop(waiting);
        // What is lost takes no room; and who hurries more than it may stands further behind in the queue.
        if accepted == Accepted::Waits && !hurries(&head) {
            self.room_bytes = self.room_bytes.saturating_sub(HEAD_BYTES + usize::from(head.len));
            self.least = self.least.at_most(head.priority);
        }
        true
    }
}

/// Whether a package stands further ahead in the mailbox than its sender may have it in the queue, see [`Outbound::accept`].
fn hurries(head: &Head) -> bool {
    matches!(head.kind.kind(), Kind::Command(_)) && head.priority.outranks(head.from.class().priority())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::{End, S, module};
    use crate::stats::Cause;
    use rohrpost_mailbox::{Label, Name, Node, Participant, Sender, Shape, Type};

    /// A package of this body takes 50 bytes of a slot.
    const BODY: [u8; 50 - HEAD_BYTES] = [7; 50 - HEAD_BYTES];
    const SLOTS: u16 = 16;

    /// A router of node 0, and a mailbox for packages to node 1.
    struct Ground {
        intake: Intake,
        sender: Sender,
        end: End,
        /// Time until the thread has to wake up.
        left_ns: u64,
        _folder: tempfile::TempDir,
    }

    impl Ground {
        /// That began so long ago.
        fn new(age_ns: u64) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
            let join = || Participant::join(&node, Name::NONE).unwrap();
            let shape = Shape { slots: SLOTS, full: rohrpost_mailbox::Full::Displace, ..Shape::default() };
            let intake = Intake::new(join().receiver(module(100, 1), shape).unwrap());
            let sender = join().sender(module(100, 1)).unwrap();
            Self {
                intake,
                sender,
                end: End::begin(0, monotonic_ns() - age_ns, |_| {}),
                left_ns: u64::MAX,
                _folder: folder,
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

        /// So many looks shortly before the call.
        fn before_the_call(&mut self, looks: usize) {
            (0..looks).for_each(|_| self.intake.take_one(&mut self.end.outbound, &mut self.end.log));
        }

        fn in_the_slot(&mut self) {
            self.intake.take_on(&mut self.end.outbound, &mut self.end.log);
        }

        fn between_slots(&mut self) {
            self.intake.relieve(&mut self.end.outbound, &mut self.end.log, || self.left_ns);
        }

        /// Packages in the mailbox, and in the queue.
        fn waiting(&mut self) -> (usize, u64) {
            (self.intake.transit.waits().0, self.end.stats.waiting_in_all())
        }
    }

    #[test]
    fn a_slot_takes_what_it_has_room_for_and_then_what_is_more_important() {
        let mut ground = Ground::new(0);
        ground.data(&[10, 90, 50, 50, 20]);
        ground.intake.open(100);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (3, 2), "90 and 50 fill it");
        ground.data(&[50]);
        ground.before_the_call(10);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (4, 2), "as important as what was taken, it waits");
        ground.data(&[95, 51]);
        ground.before_the_call(10);
        assert_eq!(ground.waiting(), (4, 4));
        ground.data(&[95; FEW + 2]);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (6, 4 + FEW as u64), "a few between two datagrams");
        ground.intake.open(10_000);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (2, 8 + FEW as u64), "who woke up late takes in the slot what it has room for");
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (0, 10 + FEW as u64), "a few before each datagram");
    }

    #[test]
    fn in_a_slot_a_mailbox_does_not_become_full_and_what_is_lost_does_not_end_it() {
        let mut ground = Ground::new(0);
        ground.intake.open(50);
        ground.data(&[90; 1]);
        ground.before_the_call(1);
        ground.data(&[90; SLOTS as usize / 2]);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (8, 1), "no room, and no more important");
        ground.data(&[90; 2]);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (8, 3), "down to half of it");

        // Their peer is silent, so that taking them gives nothing to send.
        let mut ground = Ground::new(5 * S);
        ground.data(&[90; FEW + 2]);
        ground.intake.open(1000);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (0, 0));
        assert_eq!(ground.end.log.lost.len(), FEW + 2);
    }

    #[test]
    fn what_comes_after_a_slot_that_was_not_full_waits_for_the_next() {
        let mut ground = Ground::new(0);
        ground.intake.open(1000);
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
        ground.intake.taken_ns -= UNTAKEN_NS_MAX;
        ground.between_slots();
        assert_eq!(ground.waiting(), (0, 10), "no slot came for long");
    }

    #[test]
    fn what_hurries_more_than_it_may_takes_no_room_from_what_may() {
        let mut ground = Ground::new(0);
        ground.send(Type::command(16), &[200, 200, 100]);
        ground.intake.open(50);
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
        ground.intake.open(50);
        ground.in_the_slot();
        assert_eq!(ground.waiting(), (0, 0));
        assert_eq!(ground.end.log.causes(), [Cause::Silent; 5]);
    }
}
