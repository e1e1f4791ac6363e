//! What the models are made of: a small mailbox around the real slot core, its senders and its receiver.
//!
//! What is around the core in the mailbox (`Sender`, `Receiver`, `wait_any`, the bell) maps memory and sleeps, so it is
//! written here again, small; `build.rs` fails when the lines that matter are no longer there in this order.

use crate::name::Priority;
use crate::wake::bell::Bell;
use crate::slots::bodies::Bodies;
use crate::slots::full::{OverflowPolicy, NoSlot};
use crate::slots::queue::Queue;
use crate::slots::hot::Hot;
use crate::slots::protocol::{Posted, Published, Slots};
use crate::step::{dies_at, reached};
use crate::sync::{AtomicU32, AtomicU64, Ordering};
use crate::slots::word::{Claimant, FREE, Victim, Word};
use loom::cell::UnsafeCell;
use loom::thread::{self, JoinHandle};
use std::sync::{Arc, Mutex};

/// A mailbox with bodies of one number each, watched by loom for races.
pub(super) struct Mailbox {
    pub(super) hot: Hot,
    pub(super) words: Vec<AtomicU64>,
    pub(super) bodies: Vec<UnsafeCell<u8>>,
    bell: Arc<Sleeper>,
    /// Not 0: the receiver has something else to do. The thread that says so rings.
    pub(super) other: AtomicU32,
    /// One bit for each dead participant.
    pub(super) dead: AtomicU32,
    /// Counted as having lost their place. Not loom's, so that counting adds no order to the model.
    victims: Mutex<Vec<Victim>>,
    /// Counted where their displacers went on.
    late: Mutex<Vec<Victim>>,
}

/// A participant's bell. It may receive from several mailboxes.
#[derive(Default)]
struct Sleeper {
    rings: AtomicU32,
    polling: AtomicU32,
    /// Bytes in the pipe. The kernel would order more than these plain accesses do.
    pipe: AtomicU32,
}

// SAFETY: the bodies are the only part that is not Sync by itself, and loom reports every race on them.
unsafe impl Sync for Mailbox {}

impl Mailbox {
    pub(super) fn new(slots: usize) -> Arc<Self> {
        Self::with_bell(slots, Arc::default())
    }

    /// One more mailbox of the same receiver.
    pub(super) fn beside(other: &Self, slots: usize) -> Arc<Self> {
        Self::with_bell(slots, other.bell.clone())
    }

    fn with_bell(slots: usize, bell: Arc<Sleeper>) -> Arc<Self> {
        reached("mailbox: new");
        Arc::new(Self {
            hot: Hot::default(),
            words: (0..slots).map(|_| AtomicU64::new(FREE.0)).collect(),
            bodies: (0..slots).map(|_| UnsafeCell::new(0)).collect(),
            bell,
            other: AtomicU32::new(0),
            dead: AtomicU32::new(0),
            victims: Mutex::default(),
            late: Mutex::default(),
        })
    }

    pub(super) fn slots(&self) -> Slots<'_> {
        let unseen = Bodies { first: std::ptr::null(), bytes: 0, segment: 0 };
        Slots::new(&self.hot, &self.words, 1, self.words.len(), unseen)
    }

    pub(super) fn sender(&self, participant: u16, full: OverflowPolicy) -> Sender<'_> {
        Sender { mailbox: self, by: Claimant { participant, incarnation: 1 }, cursor: 0, full, last: None }
    }

    pub(super) fn receiver(&self) -> Receiver<'_> {
        Receiver { mailbox: self, queue: Queue::new(self.words.len()), polls: false }
    }

    /// Sends these packages (priority, body) from a thread of its own; returns the bodies of the accepted ones.
    pub(super) fn send_from(
        self: &Arc<Self>,
        participant: u16,
        full: OverflowPolicy,
        packages: &'static [(u8, u8)],
    ) -> JoinHandle<Vec<u8>> {
        let mailbox = self.clone();
        thread::spawn(move || mailbox.sender(participant, full).send_all(packages))
    }

    /// A sender that dies at this step of sending these packages.
    pub(super) fn dies_sending(
        self: &Arc<Self>,
        participant: u16,
        full: OverflowPolicy,
        step: &'static str,
        packages: &'static [(u8, u8)],
    ) -> JoinHandle<bool> {
        let mailbox = self.clone();
        thread::spawn(move || {
            let died = dies_at(step, || {
                mailbox.sender(participant, full).send_all(packages);
            });
            // The kernel releases the lock by which others see it alive; a process that notices that rings.
            mailbox.dead.fetch_or(u32::from(died) << participant, Ordering::Release);
            if died {
                mailbox.ring();
            }
            died
        })
    }

    pub(super) fn is_dead(&self, by: Claimant) -> bool {
        self.dead.load(Ordering::Acquire) >> by.participant & 1 != 0
    }

    pub(super) fn count(&self, victim: Victim) {
        self.victims.lock().unwrap().push(victim);
    }

    /// Priorities of those that senders counted in the mailbox that took the place of this one.
    pub(super) fn counted_elsewhere(&self) -> Vec<u8> {
        self.late.lock().unwrap().iter().map(|victim| victim.priority.0).collect()
    }

    /// Priorities of those that gave way to more important ones.
    pub(super) fn displaced(&self) -> Vec<u8> {
        self.victims.lock().unwrap().iter().filter(|victim| !victim.replaced).map(|victim| victim.priority.0).collect()
    }

    /// How many gave way to their sender's newer ones.
    pub(super) fn replaced(&self) -> usize {
        self.victims.lock().unwrap().iter().filter(|victim| victim.replaced).count()
    }

    pub(super) fn all_free(&self) -> bool {
        (0..self.words.len()).all(|slot| self.slots().load(slot) == FREE)
    }

    fn bell(&self) -> Bell<'_> {
        Bell { rings: &self.bell.rings, polling: &self.bell.polling }
    }

    pub(super) fn ring(&self) {
        if self.bell().ring() {
            self.bell.pipe.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A futex that never returns early: a receiver that is not rung does not wake, and loom gives up on a program
    /// without end.
    pub(super) fn sleep(&self, seen: u32) {
        while self.bell.rings.load(Ordering::Relaxed) == seen {
            thread::yield_now();
        }
    }

    /// A `poll` that never returns early, unless it is told not to wait; then the pipe is emptied.
    fn poll(&self, sleeps: bool) {
        while sleeps && self.bell.pipe.load(Ordering::Relaxed) == 0 {
            thread::yield_now();
        }
        self.bell.pipe.swap(0, Ordering::Relaxed);
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Sent {
    Accepted,
    Refused,
    Retired,
    Reclaimed,
}

pub(super) struct Sender<'a> {
    pub(super) mailbox: &'a Mailbox,
    pub(super) by: Claimant,
    pub(super) cursor: usize,
    pub(super) full: OverflowPolicy,
    /// The last package: all that one sender sends here is of one state.
    pub(super) last: Option<Posted>,
}

impl Sender<'_> {
    pub(super) fn send(&mut self, priority: u8, body: u8) -> Sent {
        let slots = self.mailbox.slots();
        let mut claim = match slots.claim(self.by, &mut self.cursor, Priority(priority), self.full, self.last) {
            Ok(claim) => claim,
            Err(NoSlot::Full) => return Sent::Refused,
            Err(NoSlot::Retired) => return Sent::Retired,
        };
        let cell = &self.mailbox.bodies[claim.slot()];
        // SAFETY: the claim is ours; if that were wrong, loom would tell.
        cell.with_mut(|cell| unsafe { *cell = body });
        claim.victim().into_iter().for_each(|victim| self.mailbox.count(victim));
        if self.last.is_some_and(|old| slots.replace(&mut claim, old)) {
            claim.victim().into_iter().for_each(|victim| self.mailbox.count(victim));
        }
        match slots.publish(claim, Priority(priority)) {
            Published::Accepted { posted, wake } => {
                self.last = (self.full == OverflowPolicy::Latest).then_some(posted);
                if wake {
                    self.mailbox.ring();
                }
                Sent::Accepted
            }
            Published::Retired(claim) => {
                // SAFETY: the claim is ours again; the real sender copies the body to the mailbox that took the place.
                assert_eq!(cell.with(|cell| unsafe { *cell }), body);
                self.mailbox.late.lock().unwrap().extend(claim.late_victim());
                slots.abandon(claim);
                Sent::Retired
            }
            Published::Reclaimed => Sent::Reclaimed,
        }
    }

    pub(super) fn send_all(&mut self, packages: &[(u8, u8)]) -> Vec<u8> {
        packages.iter().filter(|(priority, body)| self.send(*priority, *body) == Sent::Accepted).map(|p| p.1).collect()
    }
}

pub(super) struct Receiver<'a> {
    pub(super) mailbox: &'a Mailbox,
    pub(super) queue: Queue,
    /// It watches descriptors too.
    pub(super) polls: bool,
}

impl Receiver<'_> {
    /// One package, read where it lies.
    pub(super) fn take(&mut self) -> Option<u8> {
        self.take_with(|_| ())
    }

    pub(super) fn take_with(&mut self, look: impl FnOnce(Word)) -> Option<u8> {
        let slots = self.mailbox.slots();
        let taken = self.queue.take(&slots)?;
        look(taken.word());
        // SAFETY: taken by us; if that were wrong, loom would tell.
        let body = self.mailbox.bodies[taken.slot()].with(|cell| unsafe { *cell });
        slots.release(taken);
        Some(body)
    }

    pub(super) fn take_times(&mut self, times: usize) -> Vec<u8> {
        (0..times).filter_map(|_| self.take()).collect()
    }

    pub(super) fn drain(&mut self) -> Vec<u8> {
        std::iter::from_fn(|| self.take()).collect()
    }

    /// None when there is something else to do.
    pub(super) fn receive(&mut self) -> Option<u8> {
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
        Self::wait_any(std::slice::from_mut(self));
    }

    /// All of one bell.
    pub(super) fn wait_any(receivers: &mut [Self]) {
        let mailbox = receivers[0].mailbox;
        let bell = mailbox.bell();
        let seen = bell.seen();
        receivers.iter().for_each(|receiver| receiver.mailbox.slots().drowsy());
        let found = |receiver: &Self| receiver.queue.may_have_more(&receiver.mailbox.slots());
        if mailbox.other.load(Ordering::Relaxed) == 0 && !receivers.iter().any(found) {
            if receivers[0].polls {
                let quiet = bell.may_poll(seen);
                mailbox.poll(quiet);
                bell.polled();
            } else {
                mailbox.sleep(seen);
            }
        }
        receivers.iter().for_each(|receiver| receiver.mailbox.slots().awake());
    }

    /// Frees what the dead left, and looks at every slot.
    pub(super) fn search(&mut self) -> usize {
        let slots = self.mailbox.slots();
        reached("search: before");
        let freed = slots.reclaim(|by| self.mailbox.is_dead(by), |victim| self.mailbox.count(victim));
        self.queue.rescan(&slots);
        self.queue.doubt();
        freed
    }
}

/// What the sender of 1 and 2 sent.
pub(super) fn of_first(received: &[u8]) -> Vec<u8> {
    received.iter().copied().filter(|body| *body <= 2).collect()
}

pub(super) fn sorted(mut bodies: Vec<u8>) -> Vec<u8> {
    bodies.sort_unstable();
    bodies
}
