//! The models: small programs that loom runs in every order of their threads' steps, with the real and each broken
//! core.

use crate::name::Priority;
use crate::rig::{Mailbox, Receiver, Sender, Sent, of_first, sorted};
use crate::slots::full::OverflowPolicy;
use crate::slots::protocol::Published;
use crate::slots::queue::Queue;
use crate::step::{dies_at, reached};
use crate::sync::Ordering;
use loom::thread;
use std::sync::Arc;

// ---- sending and receiving ----

/// One slot, used again and again: the body goes from sender to receiver and the slot back, without a race.
pub(crate) fn a_body_is_handed_over_whole() {
    let mailbox = Mailbox::new(1);
    let sender = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
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
    let twice = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
    let once = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 3)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(1);
    assert_eq!((twice.join().unwrap(), once.join().unwrap()), (vec![1, 2], vec![3]));
    received.extend(receiver.drain());
    assert_eq!(of_first(&received), [1, 2]);
    assert_eq!(sorted(received), [1, 2, 3]);
}

/// The receiver looks at slots that it was not told of, and meets the second package before it could see the first. It
/// knows the level: what it finds it takes, without another look.
pub(crate) fn a_second_package_never_passes_the_first() {
    let (mailbox, queue) = one_received(&[(10, 9)]);
    let sender = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = Receiver { queue, ..mailbox.receiver() };
    receiver.queue.rescan(&mailbox.slots());
    let mut received = receiver.take_times(1);
    assert_eq!(sender.join().unwrap(), [1, 2]);
    received.extend(receiver.drain());
    assert_eq!(received, [1, 2]);
}

/// Two claims of one sender, published the other way round: the order is that of publishing.
pub(crate) fn publishing_gives_the_order() {
    let mailbox = Mailbox::new(2);
    let slots = mailbox.slots();
    let mut sender = mailbox.sender(1, OverflowPolicy::Reject);
    let claims =
        [1, 2].map(|_| slots.claim(sender.by, &mut sender.cursor, Priority(10), OverflowPolicy::Reject, None).unwrap());
    for (claim, body) in claims.into_iter().rev().zip([1, 2]) {
        // SAFETY: the claim is ours.
        mailbox.bodies[claim.slot()].with_mut(|cell| unsafe { *cell = body });
        assert!(matches!(slots.publish(claim, Priority(10)), Published::Accepted { wake: false, .. }));
    }
    assert_eq!(mailbox.receiver().drain(), [1, 2]);
}

/// Of what waits, the more important goes first, also before what the receiver has seen long ago.
pub(crate) fn the_more_important_goes_first() {
    let mailbox = Mailbox::new(3);
    let low = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
    let high = mailbox.send_from(2, OverflowPolicy::Reject, &[(20, 3)]);
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

// ---- receiving without looking again: the level, and the alert above it ----

/// The receiver has taken the first of these packages, and said of what priority it was. The others are still there.
fn one_received(packages: &[(u8, u8)]) -> (Arc<Mailbox>, Queue) {
    let mailbox = Mailbox::new(4);
    assert_eq!(mailbox.sender(3, OverflowPolicy::Displace).send_all(packages).len(), packages.len());
    let mut receiver = mailbox.receiver();
    assert_eq!(receiver.take(), Some(packages[0].1));
    let queue = receiver.queue;
    (mailbox, queue)
}

/// A more important package comes while the receiver works off less important ones that it knows: once sent, it is
/// next.
pub(crate) fn the_urgent_passes_what_is_known() {
    let (mailbox, queue) = one_received(&[(10, 1), (10, 2), (10, 3)]);
    let mut receiver = Receiver { queue, ..mailbox.receiver() };
    let urgent = mailbox.send_from(1, OverflowPolicy::Displace, &[(20, 9)]);
    let first = receiver.take();
    urgent.join().unwrap();
    let expected: &[u8] = if first == Some(9) { &[2, 3] } else { &[9, 3] };
    assert_eq!(receiver.drain(), expected);
}

/// The same while it turns from more important ones to less important ones, and the sender has read the level before.
pub(crate) fn what_comes_as_the_level_sinks_is_next() {
    let (mailbox, queue) = one_received(&[(20, 1), (10, 2), (10, 3)]);
    let mut receiver = Receiver { queue, ..mailbox.receiver() };
    let between = mailbox.send_from(1, OverflowPolicy::Displace, &[(15, 9)]);
    let first = receiver.take();
    between.join().unwrap();
    let expected: &[u8] = if first == Some(9) { &[2, 3] } else { &[9, 3] };
    assert_eq!(receiver.drain(), expected);
}

/// The receiver dies, and what it said of the level stays. Its successor knows nothing yet, and says so before it
/// relies on it.
pub(crate) fn a_new_owner_says_its_own_level() {
    let (mailbox, _dead) = one_received(&[(30, 1), (10, 2), (10, 3)]);
    let between = mailbox.send_from(1, OverflowPolicy::Displace, &[(20, 9)]);
    let mut owner = mailbox.receiver();
    owner.search();
    let first = owner.take();
    between.join().unwrap();
    let expected: &[u8] = if first == Some(9) { &[2, 3] } else { &[9, 3] };
    assert_eq!(owner.drain(), expected);
}

/// The urgent sender dies before it alerts. When its death is noticed its package is next.
pub(crate) fn a_sender_that_dies_before_its_alert_is_heard() {
    let (mailbox, queue) = one_received(&[(10, 1), (10, 2), (10, 3)]);
    let mut receiver = Receiver { queue, ..mailbox.receiver() };
    let dead = mailbox.dies_sending(1, OverflowPolicy::Displace, "publish: hint", &[(20, 9)]);
    let first = receiver.take();
    assert!(dead.join().unwrap());
    receiver.search();
    let expected: &[u8] = if first == Some(9) { &[2, 3] } else { &[9, 3] };
    assert_eq!(receiver.drain(), expected);
}

/// Two of one priority above the level alert one after the other, and the receiver, which has seen one of them by
/// chance, heeds once: both go before what it knows.
pub(crate) fn two_alerts_are_two() {
    let (mailbox, queue) = one_received(&[(20, 1), (20, 2), (20, 3)]);
    let mut receiver = Receiver { queue, ..mailbox.receiver() };
    let one = mailbox.send_from(1, OverflowPolicy::Displace, &[(30, 8)]);
    let other = mailbox.send_from(2, OverflowPolicy::Displace, &[(30, 9)]);
    receiver.queue.look(&mailbox.slots());
    let before = receiver.take_times(2);
    one.join().unwrap();
    other.join().unwrap();
    let mut rest = receiver.drain();
    rest.retain(|body| *body <= 3 || !before.contains(body));
    assert!(rest.is_sorted_by_key(|body| *body <= 3), "passed: {before:?}, then {rest:?}");
}

/// A state that waited below the level is sent anew as important as the level, in its old place: before all that is
/// known of it.
pub(crate) fn a_state_raised_to_the_level_is_found() {
    let mailbox = Mailbox::new(5);
    let mut state = mailbox.sender(1, OverflowPolicy::Latest);
    assert_eq!(state.send(5, 1), Sent::Accepted);
    assert_eq!(mailbox.sender(2, OverflowPolicy::Reject).send_all(&[(10, 7), (10, 8), (10, 9)]), [7, 8, 9]);
    let mut receiver = mailbox.receiver();
    assert_eq!(receiver.take(), Some(7));
    assert_eq!(state.send(10, 2), Sent::Accepted);
    assert_eq!(receiver.drain(), [2, 8, 9]);
}

/// A state that the receiver knows is sent anew: the newer one is received in the place of the older, not after all
/// that is known.
pub(crate) fn the_newest_is_found_in_its_place() {
    let mailbox = Mailbox::new(4);
    assert_eq!(mailbox.sender(2, OverflowPolicy::Reject).send(10, 5), Sent::Accepted);
    let mut state = mailbox.sender(1, OverflowPolicy::Latest);
    assert_eq!(state.send(10, 1), Sent::Accepted);
    assert_eq!(mailbox.sender(3, OverflowPolicy::Reject).send(10, 6), Sent::Accepted);
    let mut receiver = mailbox.receiver();
    assert_eq!(receiver.take(), Some(5));
    assert_eq!(state.send(10, 2), Sent::Accepted);
    assert_eq!(receiver.drain(), [2, 6]);
}

// ---- full mailboxes ----

/// One slot, wanted by an unimportant sender, an important one and the receiver.
pub(crate) fn a_displaced_package_is_counted_and_not_received() {
    let mailbox = Mailbox::new(1);
    let low = mailbox.send_from(1, OverflowPolicy::Displace, &[(10, 10)]);
    let high = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
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
    let mailbox = Mailbox::new(3);
    assert_eq!(mailbox.sender(1, OverflowPolicy::Reject).send_all(&[(12, 1), (11, 2), (10, 3)]), [1, 2, 3]);
    let mut receiver = mailbox.receiver();
    receiver.queue.look(&mailbox.slots());
    let high = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 9)]);
    let first = receiver.take();
    assert_eq!(high.join().unwrap(), [9]);
    let rest = receiver.drain();
    let (urgent, known) = if first == Some(9) { (&[][..], &rest[..]) } else { rest.split_at(1) };
    assert!(urgent.iter().all(|body| *body == 9) && known.is_sorted(), "passed: {first:?}, then {rest:?}");
    assert_eq!(1 + rest.len() + mailbox.displaced().len(), 4);
    assert!(mailbox.all_free());
}

/// Two slots, both full, a receiver that empties them, and one sender that outranks all: there is always room for it.
pub(crate) fn a_sender_that_outranks_all_is_not_refused() {
    let mailbox = Mailbox::new(2);
    mailbox.sender(1, OverflowPolicy::Displace).send_all(&[(10, 10), (11, 11)]);
    let high = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
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
    mailbox.sender(1, OverflowPolicy::Displace).send_all(&[(10, 10), (11, 11)]);
    let one = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
    let other = mailbox.send_from(3, OverflowPolicy::Displace, &[(21, 21)]);
    let accepted = [vec![10, 11], one.join().unwrap(), other.join().unwrap()].concat();
    assert_eq!(accepted, [10, 11, 20, 21]);
    let mut seen = mailbox.receiver().drain();
    assert_eq!(seen, [21, 20]);
    seen.extend(mailbox.displaced());
    assert_eq!(sorted(seen), accepted, "received or displaced, never both, never neither");
    assert!(mailbox.all_free());
}

// ---- only the newest ----

/// One sender, one receiver: what is received never goes back and ends with the newest; the rest is counted as
/// replaced.
fn only_the_newest(slots: usize, packages: &'static [(u8, u8)]) {
    let mailbox = Mailbox::new(slots);
    let sender = mailbox.send_from(1, OverflowPolicy::Latest, packages);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(2);
    let accepted = sender.join().unwrap();
    received.extend(receiver.drain());
    assert!(received.is_sorted_by(|a, b| a < b), "it goes back: {received:?}");
    assert_eq!(received.last(), accepted.last(), "the newest is received");
    assert_eq!(received.len() + mailbox.replaced(), accepted.len(), "received or replaced, never both, never neither");
    assert!(mailbox.all_free());
}

/// A free slot for the newer one while the older still waits.
pub(crate) fn the_newest_replaces_what_waits() {
    only_the_newest(2, &[(10, 1), (10, 2), (10, 3)]);
}

/// No other slot than that of the older one. While the receiver has it in hand there is none.
pub(crate) fn the_newest_reuses_the_only_slot() {
    only_the_newest(1, &[(10, 1), (10, 2), (10, 3)]);
}

/// The newer one stands where the older stood, before what others sent meanwhile; and a state that is sent without end
/// keeps nobody out.
pub(crate) fn the_newest_keeps_its_place() {
    let mailbox = Mailbox::new(3);
    let mut fast = mailbox.sender(1, OverflowPolicy::Latest);
    assert_eq!(fast.send(10, 1), Sent::Accepted);
    let other = mailbox.send_from(2, OverflowPolicy::Latest, &[(10, 10)]);
    fast.send_all(&[(10, 2), (10, 3)]);
    // The other one is refused if its search for a free slot meets the state wherever it moves to.
    let expected = [vec![3], other.join().unwrap()].concat();
    assert_eq!(mailbox.receiver().drain(), expected);
    assert_eq!(mailbox.replaced(), 2);
    assert!(mailbox.all_free());
}

/// 1 in one slot, 2 in the other, then 3 where 1 was and in its place of the order: the word of 3 is that of 1. A
/// receiver that saw 1 and comes late takes 3, whole; and nothing is missed.
pub(crate) fn a_word_comes_back_with_the_newer_package() {
    let mailbox = Mailbox::new(2);
    let mut first = mailbox.sender(1, OverflowPolicy::Latest);
    first.send(10, 1);
    let (last, cursor) = (first.last, first.cursor);
    let sender = mailbox.clone();
    let sender = thread::spawn(move || {
        let mut sender = Sender { last, cursor, ..sender.sender(1, OverflowPolicy::Latest) };
        sender.send_all(&[(10, 2), (10, 3)]);
        sender.last
    });
    let slots = mailbox.slots();
    let seen = last.unwrap();
    let late = slots.take(seen.slot, seen.word).map(|taken| {
        // SAFETY: taken by us; if that were wrong, loom would tell.
        let body = mailbox.bodies[taken.slot()].with(|cell| unsafe { *cell });
        slots.release(taken);
        body
    });
    let newest = sender.join().unwrap();
    // None: it was late for 1 and early for 3. Nothing was taken from under the sender, so the word did come back.
    assert!(late.is_some() || newest == last);
    let mut received = Vec::from_iter(late);
    received.extend(mailbox.receiver().drain());
    assert!(received == [3] || received == [1, 3], "{received:?}");
    assert_eq!(received.len() + mailbox.replaced(), 3, "received or replaced, never both, never neither");
    assert!(mailbox.all_free());
}

/// A state is sent anew while somebody more important takes a slot: each is received or counted, once.
pub(crate) fn a_displaced_package_is_not_replaced_too() {
    let mailbox = Mailbox::new(1);
    let state = mailbox.send_from(1, OverflowPolicy::Latest, &[(10, 1), (10, 2)]);
    let high = mailbox.send_from(2, OverflowPolicy::Latest, &[(20, 20)]);
    let accepted = state.join().unwrap().len() + high.join().unwrap().len();
    let received = mailbox.receiver().drain();
    assert_eq!(received.len() + mailbox.replaced() + mailbox.displaced().len(), accepted);
    assert!(mailbox.all_free());
}

/// The owner gives the mailbox up while a newer package replaces the older: none of what was accepted is hidden.
pub(crate) fn a_retired_mailbox_counts_the_replaced() {
    let mailbox = Mailbox::new(2);
    let mut first = mailbox.sender(1, OverflowPolicy::Latest);
    first.send(10, 1);
    let last = first.last;
    let sender = mailbox.clone();
    let sender =
        thread::spawn(move || Sender { last, ..sender.sender(1, OverflowPolicy::Latest) }.send_all(&[(10, 2)]));
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let found = owner.drain();
    let mut settled = 0;
    slots.settle(|_| settled += 1);
    // By now: what a sender counts later, nobody sees.
    let seen = found.len() + mailbox.replaced() + settled;
    let accepted = 1 + sender.join().unwrap().len();
    assert!(seen >= accepted, "hidden: {found:?} of {accepted}");
    assert!(found.len() <= accepted);
}

// ---- sleeping ----

/// A receiver that sleeps whenever there is nothing gets everything. No assertion: a lost wake-up never ends.
pub(crate) fn no_wake_up_is_lost() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = mailbox.receiver();
    assert_eq!([receiver.receive(), receiver.receive()], [Some(1), Some(2)]);
    sender.join().unwrap();
}

/// The same with two senders: the wake-up for one is none for the other.
pub(crate) fn no_wake_up_is_lost_between_two() {
    let mailbox = Mailbox::new(2);
    let one = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1)]);
    let other = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 2)]);
    let mut receiver = mailbox.receiver();
    assert_eq!(sorted([receiver.receive(), receiver.receive()].into_iter().flatten().collect()), [1, 2]);
    one.join().unwrap();
    other.join().unwrap();
}

/// The package for which the receiver would wake is displaced: that which took its place wakes it. So does, without any
/// package, a thread that has other work for the receiver; here the sender that was refused.
pub(crate) fn no_wake_up_is_lost_when_displaced() {
    let mailbox = Mailbox::new(1);
    let low = mailbox.send_from(1, OverflowPolicy::Displace, &[(10, 10)]);
    let high = mailbox.clone();
    let high = thread::spawn(move || {
        if high.sender(2, OverflowPolicy::Displace).send(20, 20) != Sent::Accepted {
            high.other.store(1, Ordering::Relaxed);
            high.ring();
        }
    });
    let mut receiver = mailbox.receiver();
    while receiver.receive() == Some(10) {}
    low.join().unwrap();
    high.join().unwrap();
}

/// As the first, with a receiver that sleeps in `poll`, where the kernel compares nothing.
pub(crate) fn no_wake_up_is_lost_in_poll() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
    let mut receiver = Receiver { polls: true, ..mailbox.receiver() };
    assert_eq!([receiver.receive(), receiver.receive()], [Some(1), Some(2)]);
    sender.join().unwrap();
}

/// A ringer dies before it writes into the pipe: the next ringer wakes the sleeper all the same.
pub(crate) fn a_dead_ringer_takes_no_wake_up_along() {
    let mailbox = Mailbox::new(1);
    let dead = mailbox.dies_sending(1, OverflowPolicy::Reject, "bell: rung", &[(10, 1)]);
    let mut receiver = Receiver { polls: true, ..mailbox.receiver() };
    assert_eq!(receiver.receive(), Some(1));
    dead.join().unwrap();
}

/// One receiver of two mailboxes, with one bell: whatever comes to either wakes it.
pub(crate) fn no_wake_up_is_lost_between_two_mailboxes() {
    let first = Mailbox::new(1);
    let second = Mailbox::beside(&first, 1);
    let senders = [&first, &second].map(|mailbox| mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1)]));
    let mut receivers = [first.receiver(), second.receiver()];
    let mut received = [0, 0];
    while received != [1, 1] {
        for (receiver, received) in receivers.iter_mut().zip(&mut received) {
            *received += receiver.drain().len();
        }
        if received != [1, 1] {
            Receiver::wait_any(&mut receivers);
        }
    }
    senders.into_iter().for_each(|sender| assert_eq!(sender.join().unwrap(), [1]));
}

// ---- giving up ----

/// The owner gives the mailbox up while somebody sends: what was accepted is in its last look, what was not is back in
/// its sender's hands.
pub(crate) fn a_retired_mailbox_keeps_nothing() {
    let mailbox = Mailbox::new(2);
    let sender = mailbox.send_from(1, OverflowPolicy::Reject, &[(10, 1), (10, 2)]);
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
    mailbox.sender(1, OverflowPolicy::Reject).send(20, 1);
    assert!(dies_at("take: taken", || _ = mailbox.receiver().take()));
    let sender = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 2)]);
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
    mailbox.sender(1, OverflowPolicy::Displace).send(10, 10);
    let sender = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
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

/// The same, when the counters go on elsewhere: what is counted by the time the owner has settled is all that anyone
/// will ever see of this mailbox, so the victim must be in hand or counted by then.
pub(crate) fn a_replaced_mailbox_hides_no_loss() {
    let mailbox = Mailbox::new(1);
    mailbox.sender(1, OverflowPolicy::Displace).send(10, 10);
    let sender = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let mut seen = owner.drain();
    slots.settle(|victim| seen.push(victim.priority.0));
    seen.extend(mailbox.displaced());
    sender.join().unwrap();
    assert!(seen.contains(&10), "hidden");
}

/// As before, with a package that is published and displaced while the owner looks for the last time: its sender holds
/// it for accepted, so the owner finds it, or the sender that displaced it counts it, where it goes on.
pub(crate) fn a_replaced_mailbox_hides_no_late_loss() {
    let mailbox = Mailbox::new(1);
    let low = mailbox.send_from(1, OverflowPolicy::Displace, &[(10, 10)]);
    let high = mailbox.send_from(2, OverflowPolicy::Displace, &[(20, 20)]);
    let slots = mailbox.slots();
    let mut owner = mailbox.receiver();
    slots.retire();
    owner.queue.rescan(&slots);
    let mut seen = owner.drain();
    slots.settle(|victim| seen.push(victim.priority.0));
    seen.extend(mailbox.displaced());
    let accepted = low.join().unwrap();
    high.join().unwrap();
    seen.extend(mailbox.counted_elsewhere());
    assert!(accepted.iter().all(|body| seen.contains(body)), "hidden");
}

// ---- deaths ----

/// A sender dies at `step`; another sends and the receiver searches meanwhile. The dead one's package arrives if it was
/// a package, its slot is usable again, and the other one notices nothing.
fn a_sender_dies(step: &'static str, arrives: bool) {
    let mailbox = Mailbox::new(2);
    let dead = mailbox.dies_sending(1, OverflowPolicy::Displace, step, &[(10, 1)]);
    let living = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 2)]);
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

/// The dead one had displaced a package: the loss is counted, by the receiver that frees the slot if not by the dead.
///
/// At least once: a sender that dies between counting and publishing has counted it, which the receiver cannot know.
pub(crate) fn a_displacer_dies() {
    let mailbox = Mailbox::new(1);
    mailbox.sender(3, OverflowPolicy::Displace).send(10, 10);
    let dead = mailbox.dies_sending(1, OverflowPolicy::Displace, "displace: claimed", &[(20, 20)]);
    let living = mailbox.send_from(2, OverflowPolicy::Displace, &[(15, 15)]);
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

/// A sender dies on the way from the older package of a state to the newer. The older is received or counted, here or
/// there, and the newer is received if it was published; both slots are usable again.
fn a_replacer_dies(slots: usize, step: &'static str) {
    let mailbox = Mailbox::new(slots);
    let dead = mailbox.dies_sending(1, OverflowPolicy::Latest, step, &[(10, 1), (10, 2)]);
    let mut receiver = mailbox.receiver();
    let mut received = receiver.take_times(1);
    receiver.search();
    let died = dead.join().unwrap();
    receiver.search();
    received.extend(receiver.drain());
    assert!(received.is_sorted_by(|a, b| a < b), "{received:?}");
    // Not reached when the receiver was quicker: then nothing was replaced.
    assert!(died || received.contains(&2));
    let (first, replaced) = (received.contains(&1), mailbox.replaced());
    assert!(first || replaced == 1, "hidden");
    // A sender that dies between saying that it replaces and replacing is believed: the older one is counted, received.
    assert!(!(first && replaced > 0) || step == "replace: marked");
    assert!(mailbox.all_free());
}

pub(crate) fn a_replacer_dies_before_the_old_one_goes() {
    a_replacer_dies(2, "replace: marked");
}

pub(crate) fn a_replacer_dies_when_the_old_one_is_gone() {
    a_replacer_dies(2, "replace: freed");
}

pub(crate) fn a_replacer_dies_in_the_only_slot() {
    a_replacer_dies(1, "reuse: claimed");
}

/// Every slot is looked at without a hint after so many receives, deaths or not.
pub(crate) fn a_package_without_hint_is_found_in_turn() {
    let mailbox = Mailbox::new(2);
    assert!(dies_at("publish: ready", || {
        mailbox.sender(1, OverflowPolicy::Reject).send(10, 1);
    }));
    let living = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 2)]);
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
    mailbox.sender(1, OverflowPolicy::Reject).send(20, 1);
    assert!(dies_at("take: taken", || _ = mailbox.receiver().take()));
    let sender = mailbox.send_from(2, OverflowPolicy::Reject, &[(10, 2)]);
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
