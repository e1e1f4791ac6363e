//! What the runs are made of: a small mailbox around the real slot core, its senders and its receiver, as threads.
//!
//! Bodies are plain memory, so that ThreadSanitizer checks every access to them. All else is atomics. ThreadSanitizer
//! knows no fences: what a body's hand-over rested on a fence for would be reported here, though it were right. None
//! does.

use super::bell::Bell;
use super::bodies::Bodies;
use super::full::{NoSlot, OverflowPolicy};
use super::hot::Hot;
use super::protocol::{Posted, Published, Slots};
use super::queue::Queue;
use super::word::{Claimant, FREE, State, Victim};
use crate::name::Priority;
use crate::rounds;
use crate::step::{dice, reached, shake};
use crate::sync::{AtomicU32, AtomicU64, Ordering};
use std::cell::UnsafeCell;
use std::sync::atomic::AtomicU64 as Count;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// A run that goes wrong may never end; what is waited for takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);

/// Four words of which each says the same; torn, they do not.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Body([u64; 4]);

/// What became of packages, counted by the thread that did it.
#[derive(Default)]
pub(crate) struct Counts {
    pub(crate) accepted: Count,
    pub(crate) refused: Count,
    pub(crate) received: Count,
    pub(crate) gave_way: Count,
    pub(crate) unfinished: Count,
    pub(crate) closed: Count,
    /// Taken from a living sender: never.
    reclaimed: Count,
}

fn add(count: &Count) {
    count.fetch_add(1, Ordering::Relaxed);
}

pub(crate) struct Mailbox {
    hot: Hot,
    words: Vec<AtomicU64>,
    bodies: Vec<UnsafeCell<Body>>,
    rings: AtomicU32,
    polling: AtomicU32,
    pipe: AtomicU32,
    /// Senders that have not ended.
    senders: AtomicU32,
    /// One bit for each dead participant.
    dead: AtomicU32,
    pub(crate) counts: Counts,
}

// SAFETY: the bodies are the only part that is not Sync by itself. Whether the slot core keeps two threads from one
// body is what is tested here, and ThreadSanitizer is the validate.
unsafe impl Sync for Mailbox {}

impl Mailbox {
    /// Lives as long as the process: threads need no counting of references, which would order them.
    pub(crate) fn new(slots: usize) -> &'static Self {
        Box::leak(Box::new(Self {
            hot: Hot::default(),
            words: (0..slots).map(|_| AtomicU64::new(FREE.0)).collect(),
            bodies: (0..slots).map(|_| UnsafeCell::default()).collect(),
            rings: AtomicU32::new(0),
            polling: AtomicU32::new(0),
            pipe: AtomicU32::new(0),
            senders: AtomicU32::new(0),
            dead: AtomicU32::new(0),
            counts: Counts::default(),
        }))
    }

    pub(crate) fn slots(&self) -> Slots<'_> {
        let bodies = Bodies { first: self.bodies.as_ptr().cast(), bytes: size_of::<Body>(), segment: 0 };
        Slots::new(&self.hot, &self.words, 1, self.words.len(), bodies)
    }

    fn bell(&self) -> Bell<'_> {
        Bell { rings: &self.rings, polling: &self.polling }
    }

    fn ring(&self) {
        if self.bell().ring() {
            self.pipe.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn is_dead(&self, by: Claimant) -> bool {
        // The kernel's lock, by which others see which ones live, orders as much.
        self.dead.load(Ordering::Acquire) >> by.participant & 1 != 0
    }

    fn count(&self, victim: Option<Victim>) {
        victim.iter().for_each(|_| add(&self.counts.gave_way));
    }

    /// A sender on a thread of its own, that sends so many packages of this priority.
    pub(crate) fn send_from(
        &'static self,
        participant: u16,
        full: OverflowPolicy,
        priority: u8,
        packages: u64,
    ) -> JoinHandle<()> {
        self.senders.fetch_add(1, Ordering::Relaxed);
        thread::spawn(move || {
            shake(participant.into());
            let _end = End(self);
            let mut sender = Sender::new(self, participant, full);
            for _ in rounds(packages) {
                sender.send(priority);
                if dice().is_multiple_of(8) {
                    thread::yield_now();
                }
            }
        })
    }

    /// A sender that claims a slot, begins to fill it, and dies.
    pub(crate) fn dies_filling(&'static self, participant: u16, full: OverflowPolicy, priority: u8) -> JoinHandle<()> {
        self.senders.fetch_add(1, Ordering::Relaxed);
        thread::spawn(move || {
            shake(participant.into());
            let _end = End(self);
            let mut sender = Sender::new(self, participant, full);
            let claim = loop {
                match sender.slots().claim(sender.by, &mut sender.cursor, Priority(priority), full, None) {
                    Ok(claim) => break claim,
                    Err(_) => thread::yield_now(),
                }
            };
            sender.fill(claim.slot());
            self.dead.fetch_or(1 << participant, Ordering::Release);
        })
    }

    pub(crate) fn has_senders(&self) -> bool {
        self.senders.load(Ordering::Acquire) != 0
    }

    /// Every accepted package was received, or is counted; and no slot is left.
    pub(crate) fn is_accounted(&self) {
        let (accepted, known) = self.accepted_and_known();
        assert_eq!(accepted, known, "accepted, and known what became of it");
        assert!((0..self.words.len()).all(|slot| self.slots().load(slot) == FREE), "a slot is still in use");
        self.is_true();
    }

    /// No loss is hidden. One may be counted twice: by the sender that filled when the mailbox was given up, and by the
    /// owner that gave it up.
    pub(crate) fn hides_no_loss(&self) {
        let (accepted, known) = self.accepted_and_known();
        assert!(accepted <= known, "{accepted} were accepted, of {known} it is known what became of them");
        // A claim with a settled victim stays: it is no longer what its sender knows, and nobody claims here any more.
        let waits = |slot: &usize| !matches!(self.slots().load(*slot).state(), State::Free | State::Filling { .. });
        assert_eq!((0..self.words.len()).find(waits), None, "a slot still holds a package");
        self.is_true();
    }

    fn is_true(&self) {
        assert_eq!(self.counts.reclaimed.load(Ordering::Relaxed), 0, "somebody living was held for dead");
    }

    fn accepted_and_known(&self) -> (u64, u64) {
        let Counts { accepted, received, gave_way, closed, .. } = &self.counts;
        let [accepted, received, gave_way, closed] =
            [accepted, received, gave_way, closed].map(|count| count.load(Ordering::Relaxed));
        (accepted, received + gave_way + closed)
    }
}

/// Says that a sender has ended, however it did: else its receiver would wait.
struct End(&'static Mailbox);

impl Drop for End {
    fn drop(&mut self) {
        self.0.senders.fetch_sub(1, Ordering::Release);
        self.0.ring();
    }
}

pub(crate) struct Sender {
    mailbox: &'static Mailbox,
    by: Claimant,
    cursor: usize,
    full: OverflowPolicy,
    /// The last package: all that one sender sends here is of one state.
    last: Option<Posted>,
    sent: u64,
}

/// How sending ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Sent {
    Accepted,
    Refused,
    Retired,
}

impl Sender {
    pub(crate) fn new(mailbox: &'static Mailbox, participant: u16, full: OverflowPolicy) -> Self {
        Self { mailbox, by: Claimant { participant, incarnation: 1 }, cursor: 0, full, last: None, sent: 0 }
    }

    fn slots(&self) -> Slots<'static> {
        self.mailbox.slots()
    }

    fn fill(&mut self, slot: usize) {
        self.sent += 1;
        let mark = u64::from(self.by.participant) << 32 | self.sent;
        let halves = self.mailbox.bodies[slot].get().cast::<[u64; 2]>();
        // SAFETY: the claim is ours; if that were wrong, ThreadSanitizer would tell.
        unsafe { halves.write([mark; 2]) };
        reached("fill: half");
        // SAFETY: as above; a body is two halves.
        unsafe { halves.add(1).write([mark; 2]) };
    }

    pub(crate) fn send(&mut self, priority: u8) -> Sent {
        let (slots, counts) = (self.slots(), &self.mailbox.counts);
        let mut claim = match slots.claim(self.by, &mut self.cursor, Priority(priority), self.full, self.last) {
            Ok(claim) => claim,
            Err(NoSlot::Full) => {
                add(&counts.refused);
                return Sent::Refused;
            }
            Err(NoSlot::Retired) => return Sent::Retired,
        };
        self.fill(claim.slot());
        self.mailbox.count(claim.victim());
        if self.last.is_some_and(|old| slots.replace(&mut claim, old)) {
            self.mailbox.count(claim.victim());
        }
        match slots.publish(claim, Priority(priority)) {
            Published::Accepted { posted, wake } => {
                self.last = (self.full == OverflowPolicy::Latest).then_some(posted);
                add(&counts.accepted);
                if wake {
                    self.mailbox.ring();
                }
                Sent::Accepted
            }
            Published::Retired(claim) => {
                // SAFETY: the claim is ours again; the real sender copies the body to the mailbox that took the place.
                let body = unsafe { *self.mailbox.bodies[claim.slot()].get() };
                assert!(body.is_whole());
                slots.abandon(claim);
                Sent::Retired
            }
            Published::Reclaimed => {
                add(&counts.reclaimed);
                Sent::Refused
            }
        }
    }
}

impl Body {
    fn is_whole(&self) -> bool {
        self.0.iter().all(|word| *word == self.0[0])
    }
}

pub(crate) struct Receiver {
    mailbox: &'static Mailbox,
    queue: Queue,
}

impl Receiver {
    pub(crate) fn new(mailbox: &'static Mailbox) -> Self {
        Self { mailbox, queue: Queue::new(mailbox.words.len()) }
    }

    /// Takes over what another receiver left when it died with packages in hand.
    pub(crate) fn adopting(mailbox: &'static Mailbox) -> Self {
        mailbox.slots().adopt(|_| add(&mailbox.counts.closed));
        let mut receiver = Self::new(mailbox);
        receiver.queue.rescan(&mailbox.slots());
        receiver
    }

    pub(crate) fn take(&mut self) -> bool {
        self.take_and(false)
    }

    /// Takes a package, reads it, and dies with it in hand.
    pub(crate) fn take_and_die(mut self) -> bool {
        self.take_and(true)
    }

    fn take_and(&mut self, die: bool) -> bool {
        let slots = self.mailbox.slots();
        let Some(taken) = self.queue.take(&slots) else { return false };
        reached("take: before reading");
        // SAFETY: taken by us; if that were wrong, ThreadSanitizer would tell.
        let body = unsafe { *self.mailbox.bodies[taken.slot()].get() };
        assert!(body.is_whole(), "torn: {body:?}");
        if !die {
            add(&self.mailbox.counts.received);
            slots.release(taken);
        }
        true
    }

    /// Receives until all senders have ended and nothing is left; with `sleeps`, sleeps when there is nothing.
    pub(crate) fn drain(&mut self, sleeps: bool) {
        let mut until = Instant::now() + PATIENCE;
        loop {
            let more = self.mailbox.has_senders();
            while self.take() {
                until = Instant::now() + PATIENCE;
            }
            if !more && !self.queue.may_have_more(&self.mailbox.slots()) {
                return;
            }
            assert!(Instant::now() < until, "no end: something waits, and is not received");
            if sleeps && more { self.sleep(until) } else { thread::yield_now() }
        }
    }

    fn sleep(&mut self, until: Instant) {
        let (slots, bell) = (self.mailbox.slots(), self.mailbox.bell());
        let seen = bell.seen();
        slots.drowsy();
        if self.mailbox.has_senders() && !self.queue.may_have_more(&slots) {
            // By turns in `poll` and on the futex; neither returns early here.
            let quiet = if dice().is_multiple_of(2) { Some(bell.may_poll(seen)) } else { None };
            let awake = || match quiet {
                Some(quiet) => !quiet || self.mailbox.pipe.swap(0, Ordering::Relaxed) != 0,
                None => self.mailbox.rings.load(Ordering::Relaxed) != seen,
            };
            while !awake() {
                assert!(Instant::now() < until, "a wake-up was lost");
                thread::yield_now();
            }
            bell.polled();
        }
        slots.awake();
    }

    /// Frees what the dead left, and looks at every slot.
    pub(crate) fn search(&mut self) {
        let (slots, mailbox) = (self.mailbox.slots(), self.mailbox);
        for _ in 0..slots.reclaim(|by| mailbox.is_dead(by), |victim| mailbox.count(Some(victim))) {
            add(&mailbox.counts.unfinished);
        }
        self.queue.rescan(&slots);
    }

    /// Gives the mailbox up, and counts what it still held.
    pub(crate) fn retire(mut self) {
        let (slots, mailbox) = (self.mailbox.slots(), self.mailbox);
        slots.retire();
        self.queue.rescan(&slots);
        while let Some(taken) = self.queue.take(&slots) {
            // SAFETY: taken by us, as above.
            assert!(unsafe { *mailbox.bodies[taken.slot()].get() }.is_whole());
            add(&mailbox.counts.closed);
            slots.release(taken);
        }
        slots.settle(|victim| mailbox.count(Some(victim)));
    }
}
