//! The receiving side of a mailbox: read a package in place, most important first. A receiver that finds none sleeps in
//! `waiting`.

use crate::clock::monotonic_ns;
use crate::figures::counters::Loss;
use crate::memory::layout::{Shape, stored_ns};
use crate::memory::segment::Segment;
use crate::name::{Name, Priority};
use crate::node::about;
use crate::node::error::NodeError;
use crate::node::lock::Held;
use crate::node::participant::Participant;
use crate::node::unlink;
use crate::package::{Head, Options};
use crate::slots::protocol::Taken;
use crate::slots::queue::Queue;
use crate::step::step;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// When a slot was still being filled at the last search, the next one comes after so many receives and waits.
const SEARCH_AGAIN: u32 = 64;

/// The one receiver of a mailbox. Dropped, the mailbox stays, and with it what was accepted: the next owner adopts it.
/// See
/// [`Receiver::close`] to remove it.
pub struct Receiver {
    participant: Arc<Participant>,
    segment: Segment,
    queue: Queue,
    /// What waited longer is dropped.
    max_age_ns: u64,
    /// The node's count of deaths when the slots were last searched for what the dead left.
    deaths_seen: u32,
    /// Receives and waits until the slots are searched again, because one was still being filled after the last search.
    search_in: Option<u32>,
    /// The last package came when it was about to sleep: before the next sleep it looks a little longer.
    pub(crate) eager: bool,
    /// Holds the owner's lock. Below `segment`: fields drop in order, and the lock must outlast the map.
    _lock: Held,
}

impl Receiver {
    pub(crate) fn new(participant: Arc<Participant>, segment: Segment, lock: Held) -> Self {
        let queue = Queue::new(usize::from(segment.shape.slots));
        let deaths_seen = participant.node().page().deaths.load(Ordering::Acquire);
        let max_age_ns = segment.shape.max_age.map_or(u64::MAX, stored_ns);
        let mut receiver =
            Self { participant, segment, queue, max_age_ns, deaths_seen, search_in: None, eager: false, _lock: lock };
        receiver.search();
        receiver
    }

    /// The mailbox's name.
    pub fn name(&self) -> Name {
        self.segment.name
    }

    /// What it was made as.
    pub fn shape(&self) -> &Shape {
        &self.segment.shape
    }

    /// The participant that its bell wakes.
    pub fn participant(&self) -> &Arc<Participant> {
        &self.participant
    }

    /// The most important package, if there is one.
    pub fn try_receive(&mut self) -> Option<Package<'_>> {
        let in_hand = self.next()?;
        Some(self.hand_out(in_hand))
    }

    /// How many packages wait, and how important the first is: all stay where they are. One that gave way just now may
    /// still be counted.
    pub fn waits(&mut self) -> (usize, Option<Priority>) {
        self.settle();
        (self.queue.len(), self.queue.first())
    }

    #[inline(always)]
    pub(crate) fn hand_out(&self, in_hand: TakenPackage) -> Package<'_> {
        let TakenPackage { taken, head, published_ns } = in_hand;
        Package { segment: &self.segment, queue: &self.queue, taken: Some(taken), head, published_ns }
    }

    /// Lays these words beside the mailbox, in place of what an earlier owner said.
    ///
    /// # Errors
    /// When they cannot be written; what was there stays.
    pub fn set_about(&self, words: &[u8]) -> Result<(), NodeError> {
        about::set(self.participant.node(), self.name(), words)
    }

    /// Removes the mailbox. What it still holds is lost, and counted in the result.
    pub fn close(mut self) -> usize {
        let slots = self.segment.slots();
        slots.retire();
        step!("close: retired");
        // If it cannot be removed (the registry stays locked, the directory is gone), it is retired all the same:
        // nobody sends there any more, and the next receiver replaces it.
        let _ = unlink::remove(self.participant.node(), self.name());
        // After the fence of `retire` a sender either sees it and takes its package back, or its package is seen here.
        self.queue.rescan(&slots);
        let mut lost = 0;
        while let Some(taken) = self.queue.take(&slots) {
            self.segment.page().counters.lost(taken.word().priority(), Loss::Closed, 1);
            slots.release(taken);
            lost += 1;
        }
        lost
    }

    /// Takes the next package that is not too old.
    #[inline(always)]
    pub(crate) fn next(&mut self) -> Option<TakenPackage> {
        self.search_if_due();
        let slots = self.segment.slots();
        loop {
            let taken = self.queue.take(&slots)?;
            let depth = self.queue.len() as u32 + 1;
            let page = self.segment.page();
            let depth_max = &page.owner.depth_max;
            if depth > depth_max.load(Ordering::Relaxed) {
                depth_max.store(depth, Ordering::Relaxed);
            }
            let (published_ns, mut head) = self.segment.read_head(&taken);
            let waited_ns = monotonic_ns().saturating_sub(published_ns);
            if waited_ns <= self.max_age_ns {
                page.counters.received(taken.word().priority(), waited_ns, head.len.into());
                if taken.word().is_redelivered() {
                    head.options = head.options.with(Options::REDELIVERED);
                }
                return Some(TakenPackage { taken, head, published_ns });
            }
            self.segment.page().counters.lost(taken.word().priority(), Loss::Stale, 1);
            slots.release(taken);
        }
    }

    #[inline(always)]
    fn search_if_due(&mut self) {
        let due = match &mut self.search_in {
            Some(0) => true,
            Some(left) => {
                *left -= 1;
                false
            }
            None => false,
        };
        if due || self.deaths_changed() {
            self.search();
        }
    }

    /// Looks through all slots for what the dead left.
    #[cold]
    fn search(&mut self) {
        let node = self.participant.node().clone();
        // Read before the search: a death after it raises the count once more.
        self.deaths_seen = node.page().deaths.load(Ordering::Acquire);
        let me = self.participant.claimant();
        let counters = &self.segment.page().counters;
        let lost = |victim| counters.gave_way(victim);
        let slots = self.segment.slots();
        let mut filling = false;
        let dead = |by| {
            let dead = by != me && node.is_dead(by);
            filling |= !dead;
            dead
        };
        let freed = slots.reclaim(dead, lost);
        // A dead one can still look alive: a child that it was about to start holds its lock for moments.
        self.search_in = filling.then_some(SEARCH_AGAIN);
        if freed > 0 {
            // The dead had not said yet how important their packages were.
            counters.lost(Priority(0), Loss::Unfinished, freed as u64);
        }
        self.queue.rescan(&slots);
        self.queue.doubt();
    }

    /// Turns hints into what they speak of, so that those which speak of nothing keep nobody awake.
    pub(crate) fn settle(&mut self) {
        self.search_if_due();
        self.queue.look(&self.segment.slots());
    }

    pub(crate) fn drowsy(&self) {
        self.segment.slots().drowsy();
    }

    pub(crate) fn drowsy_above(&self, priority: Priority) {
        self.segment.slots().drowsy_above(priority);
    }

    pub(crate) fn awake(&self) {
        self.segment.slots().awake();
    }

    /// Has the line of the hints come here before it is looked at, and stay.
    pub(crate) fn expect(&self) {
        self.segment.slots().expect_hints();
    }

    /// Whether a package above this priority is known to wait.
    pub(crate) fn has_above(&self, priority: Priority) -> bool {
        self.queue.first().is_some_and(|first| first.0 > priority.0)
    }

    /// Whether something may have come since [`Receiver::settle`].
    pub(crate) fn has_unseen(&self) -> bool {
        self.queue.has_unseen(&self.segment.slots()) || self.deaths_changed()
    }

    fn deaths_changed(&self) -> bool {
        self.participant.node().page().deaths.load(Ordering::Relaxed) != self.deaths_seen
    }

    pub(crate) fn may_have(&self) -> bool {
        self.queue.may_have_more(&self.segment.slots()) || self.deaths_changed()
    }
}

/// A taken slot, and what its prefix says.
pub(crate) struct TakenPackage {
    taken: Taken,
    head: Head,
    published_ns: u64,
}

/// A package in hand, read where it lies. Dropped, its slot is free.
pub struct Package<'a> {
    segment: &'a Segment,
    queue: &'a Queue,
    /// None once it is released, which dropping does.
    taken: Option<Taken>,
    head: Head,
    published_ns: u64,
}

impl Package<'_> {
    /// Its head; the option `redelivered` tells that an earlier receiver died with it in hand.
    #[inline]
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// Its body.
    #[inline]
    pub fn body(&self) -> &[u8] {
        self.taken.as_ref().map_or(&[], |taken| self.segment.body(taken, self.head.len))
    }

    /// Whether others seem to wait behind it, as far as can be seen without looking at their slots.
    pub fn is_followed(&self) -> bool {
        self.queue.may_have_more(&self.segment.slots())
    }

    /// When it was published, on the monotonic clock.
    #[inline]
    pub fn published_ns(&self) -> u64 {
        self.published_ns
    }
}

impl Drop for Package<'_> {
    fn drop(&mut self) {
        if let Some(taken) = self.taken.take() {
            self.segment.slots().release(taken);
        }
    }
}
