//! The runs: each lets threads do one thing many times, and checks the accounts at the end.

use super::cell::{SeqCount, SeqLatch};
use super::full::OverflowPolicy;
use super::rig::{Mailbox, Receiver, Sender, Sent};
use crate::rounds;
use crate::step::{reached, shake};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

/// All, with what each is called.
pub(crate) const ALL: &[(&str, fn())] = &[
    ("handing_over", handing_over),
    ("sleeping", sleeping),
    ("displacing", displacing),
    ("replacing", replacing),
    ("reusing", reusing),
    ("reclaiming", reclaiming),
    ("adopting", adopting),
    ("retiring", retiring),
    ("reading_cells", reading_cells),
];

fn join(threads: impl IntoIterator<Item = JoinHandle<()>>) {
    for thread in threads {
        if let Err(panic) = thread.join() {
            std::panic::resume_unwind(panic);
        }
    }
}

/// Two slots, two senders, a receiver that never sleeps.
pub(crate) fn handing_over() {
    let mailbox = Mailbox::new(2);
    let senders = [1, 2].map(|me| mailbox.send_from(me, OverflowPolicy::Reject, 10, 60_000));
    Receiver::new(mailbox).drain(false);
    join(senders);
    mailbox.is_accounted();
    assert!(mailbox.counts.received.load(Ordering::Relaxed) > 0);
}

/// The receiver sleeps whenever there is nothing.
pub(crate) fn sleeping() {
    let mailbox = Mailbox::new(4);
    let senders = [1, 2].map(|me| mailbox.send_from(me, OverflowPolicy::Reject, 10, 20_000));
    Receiver::new(mailbox).drain(true);
    join(senders);
    mailbox.is_accounted();
}

/// Two slots, three senders of which each outranks the one before.
pub(crate) fn displacing() {
    let mailbox = Mailbox::new(2);
    let senders = [1, 2, 3].map(|me| mailbox.send_from(me, OverflowPolicy::Displace, 10 * me as u8, 50_000));
    Receiver::new(mailbox).drain(false);
    join(senders);
    mailbox.is_accounted();
    assert!(mailbox.counts.gave_way.load(Ordering::Relaxed) > 0, "nobody was displaced");
}

/// States: each newer package replaces the one of its sender that still waits.
pub(crate) fn replacing() {
    let mailbox = Mailbox::new(4);
    let senders = [1, 2].map(|me| mailbox.send_from(me, OverflowPolicy::Latest, 10 * me as u8, 50_000));
    Receiver::new(mailbox).drain(false);
    join(senders);
    mailbox.is_accounted();
    assert!(mailbox.counts.gave_way.load(Ordering::Relaxed) > 0, "nothing was replaced");
}

/// The same with one slot: the newer is written where the older was.
pub(crate) fn reusing() {
    let mailbox = Mailbox::new(1);
    let senders = [1, 2].map(|me| mailbox.send_from(me, OverflowPolicy::Latest, 10 * me as u8, 50_000));
    Receiver::new(mailbox).drain(false);
    join(senders);
    mailbox.is_accounted();
}

/// Senders die while they fill, beside two that live.
pub(crate) fn reclaiming() {
    let mailboxes = rounds(40).map(|round| {
        let mailbox = Mailbox::new(3);
        shake(round + 1);
        let dying = [1, 2].map(|me| mailbox.dies_filling(me, OverflowPolicy::Displace, 20));
        let living = [3, 4].map(|me| mailbox.send_from(me, OverflowPolicy::Displace, 10, 100));
        let mut receiver = Receiver::new(mailbox);
        while mailbox.has_senders() {
            receiver.take();
            receiver.search();
            thread::yield_now();
        }
        join(dying.into_iter().chain(living));
        receiver.search();
        receiver.drain(false);
        mailbox
    });
    // At the end: what is broken is to be seen, not only what follows from it.
    for mailbox in mailboxes.collect::<Vec<_>>() {
        mailbox.is_accounted();
        assert_eq!(mailbox.counts.unfinished.load(Ordering::Relaxed), 2);
    }
}

/// Receivers die with a package in hand, one after the other, while packages come in.
pub(crate) fn adopting() {
    let mailbox = Mailbox::new(3);
    let senders = [1, 2].map(|me| mailbox.send_from(me, OverflowPolicy::Displace, 10 * me as u8, 20_000));
    for life in rounds(250) {
        let receiver = thread::spawn(move || {
            shake(life + 100);
            let mut receiver = Receiver::adopting(mailbox);
            (0..20).for_each(|_| {
                receiver.take();
            });
            receiver.take_and_die();
        });
        join([receiver]);
    }
    Receiver::adopting(mailbox).drain(false);
    join(senders);
    mailbox.is_accounted();
}

/// Mailboxes are given up under their senders, which go on in the next.
pub(crate) fn retiring() {
    for _ in rounds(200) {
        let [old, new] = [2, 2].map(Mailbox::new);
        let senders = [1, 2].map(|me| {
            thread::spawn(move || {
                shake(me.into());
                let [mut here, mut there] =
                    [old, new].map(|mailbox| Sender::new(mailbox, me, OverflowPolicy::Displace));
                for _ in 0..100 {
                    if here.send(10 * me as u8) == Sent::Retired {
                        there.send(10 * me as u8);
                    }
                }
            })
        });
        let mut receiver = Receiver::new(old);
        (0..50).for_each(|_| {
            receiver.take();
        });
        receiver.retire();
        join(senders);
        old.hides_no_loss();
        Receiver::new(new).drain(false);
        new.is_accounted();
    }
}

/// Words of a cell, all of them one number.
type Words = [AtomicU64; 4];

#[derive(Default)]
struct Cells {
    count: SeqCount,
    words: Words,
    latch: SeqLatch,
    places: [Words; 2],
}

fn store(words: &Words, value: u64) {
    for word in words {
        word.store(value, Ordering::Relaxed);
        reached("words: stored");
    }
}

fn load(words: &Words) -> [u64; 4] {
    words.each_ref().map(|word| word.load(Ordering::Relaxed))
}

fn whole(words: [u64; 4]) -> u64 {
    assert!(words.iter().all(|word| *word == words[0]), "torn: {words:?}");
    words[0]
}

/// One thread writes cells of both types, two read them: each value is whole, and none is older than the one before.
pub(crate) fn reading_cells() {
    let cells: &'static Cells = Box::leak(Box::default());
    const LAST: u64 = u64::MAX;
    let writer = thread::spawn(move || {
        for value in rounds(20_000).chain([LAST]) {
            cells.count.write(|| store(&cells.words, value));
            cells.latch.fill(|place| store(&cells.places[place], value));
            cells.latch.publish();
        }
    });
    let readers = [1, 2].map(|seed| {
        thread::spawn(move || {
            shake(seed);
            let (mut in_place, mut latched) = (0, 0);
            while in_place < LAST || latched < LAST {
                if let Some((_, words)) = cells.count.read(|| load(&cells.words)) {
                    let value = whole(words);
                    assert!(value >= in_place, "{value} after {in_place}");
                    in_place = value;
                }
                if let Some(words) = cells.latch.read(8, |place| load(&cells.places[place])) {
                    let value = whole(words);
                    assert!(value >= latched, "{value} after {latched}");
                    latched = value;
                }
                thread::yield_now();
            }
        })
    });
    join(readers.into_iter().chain([writer]));
}
