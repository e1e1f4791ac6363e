//! The models. Each is one small program, run by loom in every order of its threads' steps and with every stale value
//! that a load may read. This file is compiled beside the real slot core and beside each broken one.
//!
//! What is around the core in the mailbox (`Sender`, `Receiver`, `wait_any`, the bell) maps memory and sleeps, so it is
//! written here again, small; `build.rs` fails when the lines that matter are no longer there in this order.

use crate::name::Priority;
use crate::queue::Queue;
use crate::slots::{Full, HINT_WORDS, Hot, NoSlot, Published, Slots};
use crate::step::{dies_at, reached};
use crate::sync::{AtomicU32, AtomicU64, Ordering};
use crate::word::{Claimant, FREE, Word};
use loom::cell::UnsafeCell;
use loom::thread::{self, JoinHandle};
use std::sync::{Arc, Mutex};

/// A mailbox whose bodies are one number each, watched by loom for races.
struct Mailbox {
    hot: Hot,
    words: Vec<AtomicU64>,
    bodies: Vec<UnsafeCell<u8>>,
    bell: AtomicU32,
    /// Not 0: the receiver has something else to do. Whoever says so rings.
    other: AtomicU32,
    /// One bit for each dead participant.
    dead: AtomicU32,
    /// Priorities counted as displaced. Not loom's, so that counting adds no order to the model.
    displaced: Mutex<Vec<u8>>,
}

// SAFETY: the bodies are the only part that is not Sync by itself, and loom reports every race on them.
unsafe impl Sync for Mailbox {}

impl Mailbox {
    fn new(slots: usize) -> Arc<Self> {
        reached("mailbox: new");
        let hot = Hot {
            ticket: AtomicU64::new(0),
            sleeping: AtomicU32::new(0),
            retired: AtomicU32::new(0),
            ready: [(); HINT_WORDS].map(|()| AtomicU64::new(0)),
        };
        Arc::new(Self {
            hot,
            words: (0..slots).map(|_| AtomicU64::new(FREE.0)).collect(),
            bodies: (0..slots).map(|_| UnsafeCell::new(0)).collect(),
            bell: AtomicU32::new(0),
            other: AtomicU32::new(0),
            dead: AtomicU32::new(0),
            displaced: Mutex::default(),
        })
    }

    fn slots(&self) -> Slots<'_> {
        Slots::new(&self.hot, &self.words, 1, self.words.len())
    }

    fn sender(&self, participant: u16, full: Full) -> Sender<'_> {
        Sender { mailbox: self, by: Claimant { participant, incarnation: 1 }, cursor: 0, full }
    }

    fn receiver(&self) -> Receiver<'_> {
        Receiver { mailbox: self, queue: Queue::new(self.words.len()) }
    }

    /// Sends these packages (priority, body) from a thread of its own; returns the bodies of the accepted ones.
    fn send_from(self: &Arc<Self>, participant: u16, full: Full, packages: &'static [(u8, u8)]) -> JoinHandle<Vec<u8>> {
        let mailbox = self.clone();
        thread::spawn(move || mailbox.sender(participant, full).send_all(packages))
    }

    /// A sender that dies at this step of sending one package.
    fn dies_sending(
        self: &Arc<Self>,
        participant: u16,
        step: &'static str,
        package: &'static (u8, u8),
    ) -> JoinHandle<bool> {
        let mailbox = self.clone();
        thread::spawn(move || {
            let died = dies_at(step, || {
                mailbox.sender(participant, Full::Displace).send(package.0, package.1);
            });
            // The kernel releases the lock by which others see it alive.
            mailbox.dead.fetch_or(u32::from(died) << participant, Ordering::Release);
            died
        })
    }

    fn is_dead(&self, by: Claimant) -> bool {
        self.dead.load(Ordering::Acquire) >> by.participant & 1 != 0
    }

    fn count_displaced(&self, priority: Priority) {
        self.displaced.lock().unwrap().push(priority.0);
    }

    fn displaced(&self) -> Vec<u8> {
        self.displaced.lock().unwrap().clone()
    }

    fn all_free(&self) -> bool {
        (0..self.words.len()).all(|slot| self.slots().load(slot) == FREE)
    }

    fn ring(&self) {
        self.bell.fetch_add(1, Ordering::Release);
    }

    /// A futex that never returns early: who is not rung does not wake, and loom gives up on a program without end.
    fn sleep(&self, seen: u32) {
        while self.bell.load(Ordering::Relaxed) == seen {
            thread::yield_now();
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Sent {
    Accepted,
    Refused,
    Retired,
    Reclaimed,
}

struct Sender<'a> {
    mailbox: &'a Mailbox,
    by: Claimant,
    cursor: usize,
    full: Full,
}

impl Sender<'_> {
    fn send(&mut self, priority: u8, body: u8) -> Sent {
        let slots = self.mailbox.slots();
        let claim = match slots.claim(self.by, &mut self.cursor, Priority(priority), self.full) {
            Ok(claim) => claim,
            Err(NoSlot::Full) => return Sent::Refused,
            Err(NoSlot::Retired) => return Sent::Retired,
        };
        let cell = &self.mailbox.bodies[claim.slot];
        // SAFETY: the claim is ours; if that were wrong, loom would tell.
        cell.with_mut(|cell| unsafe { *cell = body });
        claim.displaced().into_iter().for_each(|priority| self.mailbox.count_displaced(priority));
        match slots.publish(claim, Priority(priority)) {
            Published::Accepted { wake } => {
                if wake {
                    self.mailbox.ring();
                }
                Sent::Accepted
            }
            Published::Retired => {
                // SAFETY: the claim is ours again; the real sender copies the body to the mailbox that took the place.
                assert_eq!(cell.with(|cell| unsafe { *cell }), body);
                slots.abandon(claim);
                Sent::Retired
            }
            Published::Reclaimed => Sent::Reclaimed,
        }
    }

    fn send_all(&mut self, packages: &[(u8, u8)]) -> Vec<u8> {
        packages.iter().filter(|(priority, body)| self.send(*priority, *body) == Sent::Accepted).map(|p| p.1).collect()
    }
}

struct Receiver<'a> {
    mailbox: &'a Mailbox,
    queue: Queue,
}

impl Receiver<'_> {
    /// One package, read where it lies.
    fn take(&mut self) -> Option<u8> {
        self.take_with(|_| ())
    }

    fn take_with(&mut self, look: impl FnOnce(Word)) -> Option<u8> {
        let slots = self.mailbox.slots();
        let taken = self.queue.take(&slots)?;
        look(taken.word);
        // SAFETY: taken by us; if that were wrong, loom would tell.
        let body = self.mailbox.bodies[taken.slot].with(|cell| unsafe { *cell });
        slots.release(taken);
        Some(body)
    }

    fn take_times(&mut self, times: usize) -> Vec<u8> {
        (0..times).filter_map(|_| self.take()).collect()
    }

    fn drain(&mut self) -> Vec<u8> {
        std::iter::from_fn(|| self.take()).collect()
    }

    /// None when there is something else to do.
    fn receive(&mut self) -> Option<u8> {
        loop {
            if let Some(body) = self.take() {
                return Some(body);
            }
            if self.mailbox.other.load(Ordering::Relaxed) != 0 {
                return None;
            }
            self.wait();
        }
    }

    fn wait(&mut self) {
        let slots = self.mailbox.slots();
        let seen = self.mailbox.bell.load(Ordering::Acquire);
        slots.drowsy();
        if self.mailbox.other.load(Ordering::Relaxed) == 0 && !self.queue.may_have_more(&slots) {
            self.mailbox.sleep(seen);
        }
        slots.awake();
    }

    /// Frees what the dead left, and looks at every slot.
    fn search(&mut self) -> usize {
        let slots = self.mailbox.slots();
        reached("search: before");
        let freed = slots.reclaim(|by| self.mailbox.is_dead(by), |priority| self.mailbox.count_displaced(priority));
        self.queue.rescan(&slots);
        freed
    }
}

/// What the sender of 1 and 2 sent.
fn of_first(received: &[u8]) -> Vec<u8> {
    received.iter().copied().filter(|body| *body <= 2).collect()
}

fn sorted(mut bodies: Vec<u8>) -> Vec<u8> {
    bodies.sort_unstable();
    bodies
}

// ---- sending and receiving ----

/// One slot, used again and again: the body goes from sender to receiver and the slot back, without a race.
pub(crate) fn a_body_is_handed_over_whole() {
    let mailbox = Mailbox::new(1);
    let sender = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(2);
    let accepted = sender.join().unwrap();
    received.extend(receiver.drain());
    assert_eq!(received, accepted);
    assert!(mailbox.all_free());
}

/// Two senders, enough slots: everything arrives, once, and each sender's packages in its order.
pub(crate) fn everything_arrives_once_and_in_order() {
    let mailbox = Mailbox::new(3);
    let twice = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let once = mailbox.send_from(2, Full::Reject, &[(10, 3)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(1);
    assert_eq!((twice.join().unwrap(), once.join().unwrap()), (vec![1, 2], vec![3]));
    received.extend(receiver.drain());
    assert_eq!(of_first(&received), [1, 2]);
    assert_eq!(sorted(received), [1, 2, 3]);
}

/// The receiver looks at slots that it was not told of, and meets the second package before it could see the first.
pub(crate) fn a_second_package_never_passes_the_first() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = mailbox.receiver();
    receiver.search();
    let mut received = receiver.take_times(1);
    assert_eq!(sender.join().unwrap(), [1, 2]);
    received.extend(receiver.drain());
    assert_eq!(received, [1, 2]);
}

/// Two claims of one sender, published the other way round: the order is that of publishing.
pub(crate) fn publishing_gives_the_order() {
    let mailbox = Mailbox::new(2);
    let slots = mailbox.slots();
    let mut sender = mailbox.sender(1, Full::Reject);
    let claims = [1, 2].map(|_| slots.claim(sender.by, &mut sender.cursor, Priority(10), Full::Reject).unwrap());
    for (claim, body) in claims.into_iter().rev().zip([1, 2]) {
        // SAFETY: the claim is ours.
        mailbox.bodies[claim.slot].with_mut(|cell| unsafe { *cell = body });
        assert_eq!(slots.publish(claim, Priority(10)), Published::Accepted { wake: false });
    }
    assert_eq!(mailbox.receiver().drain(), [1, 2]);
}

/// Of what waits, the more important goes first, also before what the receiver has seen long ago.
pub(crate) fn the_more_important_goes_first() {
    let mailbox = Mailbox::new(3);
    let low = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let high = mailbox.send_from(2, Full::Reject, &[(20, 3)]);
    let mut receiver = mailbox.receiver();
    let first = receiver.take();
    low.join().unwrap();
    high.join().unwrap();
    let rest = receiver.drain();
    let expected: &[u8] = match first {
        None => &[3, 1, 2],
        Some(1) => &[3, 2],
        Some(3) => &[1, 2],
        other => panic!("{other:?} came first"),
    };
    assert_eq!(rest, expected);
}

// ---- full mailboxes ----

/// One slot, wanted by an unimportant sender, an important one and the receiver.
pub(crate) fn who_is_displaced_is_counted_and_not_received() {
    let mailbox = Mailbox::new(1);
    let low = mailbox.send_from(1, Full::Displace, &[(10, 10)]);
    let high = mailbox.send_from(2, Full::Displace, &[(20, 20)]);
    let mut receiver = mailbox.receiver();
    let mut seen = receiver.take_times(1);
    let accepted = [low.join().unwrap(), high.join().unwrap()].concat();
    seen.extend(receiver.drain());
    seen.extend(mailbox.displaced());
    assert_eq!(sorted(seen), accepted, "received or displaced, never both, never neither");
    assert!(mailbox.all_free());
}

/// Slots change their packages while the receiver has them in its heap: what is left still comes in order.
pub(crate) fn displacing_keeps_the_order() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, Full::Reject).send(10, 1);
    let low = mailbox.send_from(1, Full::Reject, &[(10, 2)]);
    let high = mailbox.send_from(2, Full::Displace, &[(20, 3)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(1);
    let accepted = 1 + low.join().unwrap().len() + high.join().unwrap().len();
    received.extend(receiver.drain());
    assert!(of_first(&received).is_sorted());
    assert_eq!(received.len() + mailbox.displaced().len(), accepted);
    assert!(mailbox.all_free());
}

/// Two slots, both full, a receiver that empties them, and one sender who outranks all: there is always room for it.
pub(crate) fn who_outranks_all_is_not_refused() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, Full::Displace).send_all(&[(10, 10), (11, 11)]);
    let high = mailbox.send_from(2, Full::Displace, &[(20, 20)]);
    let mut receiver = mailbox.receiver();
    let mut seen = receiver.take_times(2);
    assert_eq!(high.join().unwrap(), [20]);
    seen.extend(receiver.drain());
    seen.extend(mailbox.displaced());
    assert_eq!(sorted(seen), [10, 11, 20]);
    assert!(mailbox.all_free());
}

/// Two slots, both full: the newest of the least important gives way, once for each that is more important.
pub(crate) fn two_displace_two() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, Full::Displace).send_all(&[(10, 10), (11, 11)]);
    let one = mailbox.send_from(2, Full::Displace, &[(20, 20)]);
    let other = mailbox.send_from(3, Full::Displace, &[(21, 21)]);
    let accepted = [vec![10, 11], one.join().unwrap(), other.join().unwrap()].concat();
    assert_eq!(accepted, [10, 11, 20, 21]);
    let mut seen = mailbox.receiver().drain();
    assert_eq!(seen, [21, 20]);
    seen.extend(mailbox.displaced());
    assert_eq!(sorted(seen), accepted, "received or displaced, never both, never neither");
    assert!(mailbox.all_free());
}

// ---- sleeping ----

/// A receiver that sleeps whenever there is nothing gets everything. No assertion: a lost wake-up never ends.
pub(crate) fn no_wake_up_is_lost() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = mailbox.receiver();
    assert_eq!([receiver.receive(), receiver.receive()], [Some(1), Some(2)]);
    sender.join().unwrap();
}

/// The same with two senders: the wake-up for one is none for the other.
pub(crate) fn no_wake_up_is_lost_between_two() {
    let mailbox = Mailbox::new(2);
    let one = mailbox.send_from(1, Full::Reject, &[(10, 1)]);
    let other = mailbox.send_from(2, Full::Reject, &[(10, 2)]);
    let mut receiver = mailbox.receiver();
    assert_eq!(sorted([receiver.receive(), receiver.receive()].into_iter().flatten().collect()), [1, 2]);
    one.join().unwrap();
    other.join().unwrap();
}

/// The package for which the receiver would wake is displaced: that which took its place wakes it. So does, without any
/// package, whoever has other work for the receiver; here the sender that was refused.
pub(crate) fn no_wake_up_is_lost_when_displaced() {
    let mailbox = Mailbox::new(1);
    let low = mailbox.send_from(1, Full::Displace, &[(10, 10)]);
    let high = mailbox.clone();
    let high = thread::spawn(move || {
        if high.sender(2, Full::Displace).send(20, 20) != Sent::Accepted {
            high.other.store(1, Ordering::Relaxed);
            high.ring();
        }
    });
    let mut receiver = mailbox.receiver();
    while receiver.receive() == Some(10) {}
    low.join().unwrap();
    high.join().unwrap();
}

// ---- giving up ----

/// The owner gives the mailbox up while somebody sends: what was accepted is in its last look, what was not is back in
/// its sender's hands.
pub(crate) fn a_retired_mailbox_keeps_nothing() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, Full::Reject, &[(10, 1), (10, 2)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let found = owner.drain();
    assert_eq!(found, sender.join().unwrap(), "the last look finds what was accepted, and nothing else");
    assert!(mailbox.all_free());
}

/// As above; the owner before had died with a package in hand.
pub(crate) fn a_retired_mailbox_keeps_nothing_of_the_dead() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, Full::Reject).send(20, 1);
    assert!(dies_at("take: taken", || _ = mailbox.receiver().take()));
    let sender = mailbox.send_from(2, Full::Reject, &[(10, 2)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    slots.adopt(|_| unreachable!("it is handed out for the second time only"));
    owner.queue.rescan(&slots);
    let found = owner.drain();
    assert_eq!(found, [vec![1], sender.join().unwrap()].concat());
    assert!(mailbox.all_free());
}

/// As above, with a displacement on the way: the victim was accepted, so its loss is counted, also if the package that
/// displaced it goes elsewhere.
pub(crate) fn a_retired_mailbox_counts_the_displaced() {
    let mailbox = Mailbox::new(1);
    mailbox.sender(1, Full::Displace).send(10, 10);
    let sender = mailbox.send_from(2, Full::Displace, &[(20, 20)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let mut seen = owner.drain();
    let accepted = [vec![10], sender.join().unwrap()].concat();
    seen.extend(mailbox.displaced());
    assert_eq!(sorted(seen), accepted);
    assert!(mailbox.all_free());
}

/// The same, when the counters go on elsewhere: what is counted by the time the owner has settled is all that anyone will
/// ever see of this mailbox, so the victim must be in hand or counted by then.
pub(crate) fn a_replaced_mailbox_hides_no_loss() {
    let mailbox = Mailbox::new(1);
    mailbox.sender(1, Full::Displace).send(10, 10);
    let sender = mailbox.send_from(2, Full::Displace, &[(20, 20)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let mut seen = owner.drain();
    slots.settle(|priority| seen.push(priority.0));
    seen.extend(mailbox.displaced());
    sender.join().unwrap();
    assert!(seen.contains(&10), "hidden");
}

// ---- deaths ----

/// A sender dies at `step`; another sends and the receiver searches meanwhile. The dead one's package arrives if it was
/// a package, its slot is usable again, and the other one notices nothing.
fn a_sender_dies(step: &'static str, arrives: bool) {
    let mailbox = Mailbox::new(2);
    let dead = mailbox.dies_sending(1, step, &(10, 1));
    let living = mailbox.send_from(2, Full::Reject, &[(10, 2)]);
    let mut receiver = mailbox.receiver();
    receiver.search();
    let mut received = receiver.take_times(1);
    assert!(dead.join().unwrap(), "{step}");
    assert_eq!(living.join().unwrap(), [2]);
    receiver.search();
    received.extend(receiver.drain());
    assert_eq!(sorted(received), if arrives { vec![1, 2] } else { vec![2] });
    assert!(mailbox.all_free());
}

pub(crate) fn a_sender_dies_with_a_claim() {
    a_sender_dies("claim: claimed", false);
}

pub(crate) fn a_sender_dies_with_a_ticket() {
    a_sender_dies("publish: ticket", false);
}

pub(crate) fn a_sender_dies_without_its_hint() {
    a_sender_dies("publish: ready", true);
}

pub(crate) fn a_sender_dies_after_its_hint() {
    a_sender_dies("publish: hint", true);
}

/// The dead one had displaced a package: the loss is counted, by whoever frees the slot if not by the dead.
///
/// At least once: who dies between counting and publishing has counted it, and whoever frees the slot cannot know.
pub(crate) fn a_displacer_dies() {
    let mailbox = Mailbox::new(1);
    mailbox.sender(3, Full::Displace).send(10, 10);
    let dead = mailbox.dies_sending(1, "displace: claimed", &(20, 20));
    let living = mailbox.send_from(2, Full::Displace, &[(15, 15)]);
    let mut receiver = mailbox.receiver();
    let mut seen = receiver.take_times(1);
    receiver.search();
    let died = dead.join().unwrap();
    let mut accepted = [vec![10], living.join().unwrap()].concat();
    receiver.search();
    seen.extend(receiver.drain());
    seen.extend(mailbox.displaced());
    // Not reached when the receiver was quicker: then the slot was free and nobody had to give way.
    accepted.extend((!died && seen.contains(&20)).then_some(20));
    assert_eq!(sorted(seen), accepted);
    assert!(mailbox.all_free());
}

/// Every slot is looked at without a hint after so many receives, deaths or not.
pub(crate) fn a_package_without_hint_is_found_in_turn() {
    let mailbox = Mailbox::new(2);
    assert!(dies_at("publish: ready", || {
        mailbox.sender(1, Full::Reject).send(10, 1);
    }));
    let living = mailbox.send_from(2, Full::Reject, &[(10, 2)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(1);
    living.join().unwrap();
    received.extend(receiver.take_times(2 * 16));
    assert_eq!(sorted(received), [1, 2]);
}

/// A receiver dies with a package in hand, its successor too, while somebody sends: the package is handed out twice,
/// the second time marked, then it is poison. The other package arrives once.
pub(crate) fn a_package_in_dead_hands_is_delivered_once_more() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, Full::Reject).send(20, 1);
    assert!(dies_at("take: taken", || _ = mailbox.receiver().take()));
    let sender = mailbox.send_from(2, Full::Reject, &[(10, 2)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.adopt(|_| unreachable!("it is handed out for the second time only"));
    owner.search();
    assert!(dies_at("take: taken", || _ = owner.take()));
    let in_hand = slots.load(0);
    assert_eq!((in_hand.priority(), in_hand.is_redelivered()), (Priority(20), true));
    let mut poisoned = Vec::new();
    let mut owner = mailbox.receiver();
    slots.adopt(|priority| poisoned.push(priority.0));
    owner.search();
    assert_eq!(poisoned, [20]);
    sender.join().unwrap();
    assert_eq!(owner.drain(), [2]);
    assert!(mailbox.all_free());
}
