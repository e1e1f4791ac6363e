//! The slot core: how senders and one receiver share the slots of a mailbox, with atomics alone.
//!
//! Nothing here maps memory, sleeps, or touches a body (see `segment`, `doorbell`, `sender`, `receiver`), so that loom
//! can check it as it stands. Each operation takes a number of steps bounded by the slot count and never waits for
//! another process; a process that dies between any two steps leaves a state that the others fix:
//!
//! | died | left behind | what fixes it, and how |
//! | --- | --- | --- |
//! | sender, claimed, not published | Filling | receiver's `reclaim`: Free again; the package was never accepted |
//! | sender, with its ticket | Filling, and a ticket that nobody has | the same; the count of accepted packages is one too high |
//! | sender, displacing, reusing | Filling with its victim | `reclaim` counts that loss |
//! | sender, displacing, victim counted | the same | `reclaim` counts that loss once more: one too many, never one too few |
//! | sender, replacing | Filling with its victim, which may still be Ready | `reclaim` counts a loss, perhaps one too many |
//! | sender, published, hint not set | Ready without hint | receiver's rescan, one word in turn, or all when the death is noticed: found and delivered |
//! | sender, hinted, not alerted | Ready, and a receiver that works off less important packages | found when those it knows are received, or when the death is noticed (`Queue::doubt`): then it is next |
//! | sender, all said, bell not rung | a receiver asleep | the next sender sees it asleep and rings; so does the process that notices the death |
//! | receiver, hints in its private heap | Ready without hints | the next owner's rescan |
//! | receiver, level said | a level that nobody works at | the next owner looks before it receives, and says its own |
//! | receiver, asleep | `sleeping`, and senders that ring for nobody | the next owner's `adopt` |
//! | receiver, package in hand | Taken | the next owner's `adopt`: Ready, redelivered; the second time dropped as poison |
//! | new owner, adopting | some Taken, some Ready again | the owner after it: each word tells by itself what is due |
//! | owner, giving up | `retired`, and packages | the next receiver of this name replaces it and counts them |
//!
//! Orderings. The body is handed over by the word: publishing is a Release (A), taking an Acquire (B); freeing is a
//! Release (C), claiming an Acquire (D). Hints against `sleeping`, `retired` and `level` are settled by (E), (F), (G)
//! and (J).

use crate::name::Priority;
use crate::slots::bodies::Bodies;
use crate::slots::full::{NoSlot, OverflowPolicy};
use crate::slots::hot::{Hot, rings};
use crate::slots::word::{Claimant, FREE, State, Victim, Word};
use crate::step::step;
use crate::sync::{AtomicU64, Ordering, fence, prefetch_to_write, seq_cst_accesses};
use std::hint::spin_loop;

/// Most slots that a mailbox can have.
pub const SLOTS_MAX: usize = 1024;
/// A sender looks through a full mailbox this often for somebody to displace before it calls it full: each further
/// look is owed to another process that was quicker, and n looks at n slots would be n².
const DISPLACE_LOOKS_MAX: usize = 4;
/// A search for a free slot pauses after each of its first looks in vain. A slot in use is one that the receiver has
/// not come to: it may share the core with this sender, and owns the lines that are looked at. Without the pauses four
/// senders lose a quarter of their rate. Few, so that a search in a large mailbox stays short.
const PAUSES: usize = 8;

/// A slot being filled; its owner alone may write the body. It is the only one of its slot: it cannot be copied,
/// nothing else makes one, and [`Slots::publish`] and [`Slots::abandon`] consume it. Dropped, it stays claimed until
/// its participant dies.
#[must_use = "the slot stays claimed until this is published or abandoned"]
#[derive(Debug)]
pub(crate) struct Claim {
    slot: usize,
    segment: u64,
    word: Word,
    /// The package that this one replaces, or [`FREE`]. No `Option`: a claim is moved as plain numbers.
    place: Word,
    /// It displaced a package when the mailbox had been given up: perhaps after its owner looked for the last time.
    late: bool,
}

impl Claim {
    pub(crate) fn slot(&self) -> usize {
        self.slot
    }

    pub(crate) fn segment(&self) -> u64 {
        self.segment
    }

    /// The accepted package that lost its place to this one.
    pub(crate) fn victim(&self) -> Option<Victim> {
        match self.word.state() {
            State::Filling { victim, .. } => victim,
            _ => None,
        }
    }

    /// The victim, if its loss may have been counted where nobody looks any more.
    pub(crate) fn late_victim(&self) -> Option<Victim> {
        self.victim().filter(|_| self.late)
    }
}

/// A published package, as its sender remembers it. Whether it still waits, only a compare-and-swap tells. No two
/// senders have the same ticket, so no other sender's package has this word. This sender's may have it once more: A,
/// then B in another slot, then C where A was, all in A's place of the order. C is of the same state as A and newer,
/// and its word is swapped in after its body was written; so a sender that remembers A's word, and comes late, gets C
/// whole (loom: `a_word_comes_back_with_the_newer_package`).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Posted {
    pub(crate) slot: usize,
    pub(crate) word: Word,
}

impl Posted {
    fn as_victim(self) -> Victim {
        Victim { priority: self.word.priority(), replaced: true }
    }
}

/// How publishing ended.
#[derive(Debug)]
pub(crate) enum Published {
    /// Accepted. `wake`: the receiver sleeps, ring its bell.
    Accepted { posted: Posted, wake: bool },
    /// The mailbox was given up meanwhile; the slot is the filler's again, send its package anew.
    Retired(Claim),
    /// The receiver held the filler for dead and took the slot back: the package is not accepted.
    Reclaimed,
}

/// A taken package; its receiver alone may read the body. The only one of its slot, like a [`Claim`], until it is
/// released.
#[must_use = "the slot stays taken until this is released"]
#[derive(Debug)]
pub(crate) struct Taken {
    slot: usize,
    segment: u64,
    word: Word,
}

impl Taken {
    pub(crate) fn slot(&self) -> usize {
        self.slot
    }

    pub(crate) fn segment(&self) -> u64 {
        self.segment
    }

    pub(crate) fn word(&self) -> Word {
        self.word
    }
}

/// The shared part of a mailbox's slots, as every process sees it.
#[derive(Clone, Copy)]
pub(crate) struct Slots<'a> {
    pub(crate) hot: &'a Hot,
    words: &'a [AtomicU64],
    /// Words from one slot's to the next: 8 keeps each in a cache line of its own.
    stride: usize,
    count: usize,
    bodies: Bodies,
}

impl<'a> Slots<'a> {
    /// `words` are enough for `count` at `stride`: both come from a checked layout, and each use is checked once more.
    #[inline(always)]
    pub(crate) fn new(hot: &'a Hot, words: &'a [AtomicU64], stride: usize, count: usize, bodies: Bodies) -> Self {
        debug_assert!(count > 0 && count <= SLOTS_MAX && words.len() > (count - 1) * stride);
        Self { hot, words, stride, count, bodies }
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    fn word(&self, slot: usize) -> &'a AtomicU64 {
        &self.words[slot * self.stride]
    }

    /// ORDERING: Acquire (B), for the receiver that takes what this sees, and for `Queue::look`: all that the package's
    /// sender hinted before is seen after this.
    pub(crate) fn load(&self, slot: usize) -> Word {
        Word(self.word(slot).load(Ordering::Acquire))
    }

    /// ORDERING: Acquire and Release at once, (A) to (D): every change both takes over what the last one left and hands
    /// on. SeqCst for (E), of the changes to Ready and by `displace`; one that fails has ordered nothing.
    fn change(&self, slot: usize, from: Word, to: Word) -> bool {
        self.word(slot).compare_exchange(from.0, to.0, Ordering::SeqCst, Ordering::Relaxed).is_ok()
    }

    /// Panics on a slot of another segment: somebody else may use it there.
    fn is_of_this(&self, segment: u64) {
        assert_eq!(segment, self.bodies.segment, "a slot of another segment");
    }

    // ---- senders ----

    /// A slot to fill. `cursor` is the sender's own: the search goes on where the last one ended. `old` is what the
    /// package would replace, if it is known by now.
    #[inline(always)]
    pub(crate) fn claim(
        &self,
        by: Claimant,
        cursor: &mut usize,
        priority: Priority,
        full: OverflowPolicy,
        old: Option<Posted>,
    ) -> Result<Claim, NoSlot> {
        if self.is_retired() {
            return Err(NoSlot::Retired);
        }
        let word = Word::filling(by, None);
        for missed in 0..self.count {
            let slot = if *cursor < self.count { *cursor } else { 0 };
            *cursor = slot + 1;
            step!("claim: before");
            if Word(self.word(slot).load(Ordering::Relaxed)) == FREE && self.change(slot, FREE, word) {
                step!("claim: claimed");
                return Ok(Claim { slot, segment: self.bodies.segment, word, place: FREE, late: false });
            }
            if missed < PAUSES {
                spin_loop();
            }
        }
        match full {
            OverflowPolicy::Displace => self.displace(by, priority).ok_or(NoSlot::Full),
            OverflowPolicy::Latest => {
                let reused = old.and_then(|old| self.reuse(by, old));
                reused.or_else(|| self.displace(by, priority)).ok_or(NoSlot::Full)
            }
            OverflowPolicy::Reject => Err(NoSlot::Full),
        }
    }

    /// Takes the slot of the newest of the least important packages, if `priority` outranks it, or one that was freed
    /// since the search for one: a sender that outranks all is not refused because the receiver is quick.
    fn displace(self, by: Claimant, priority: Priority) -> Option<Claim> {
        for _ in 0..DISPLACE_LOOKS_MAX {
            let words = (0..self.count).map(|slot| (slot, self.load(slot)));
            let usable =
                words.filter(|(_, word)| *word == FREE || word.is_ready() && priority.outranks(word.priority()));
            let (slot, last) = usable.min_by_key(|(_, word)| (*word != FREE, word.rank()))?;
            let victim = (last != FREE).then(|| Victim { priority: last.priority(), replaced: false });
            let word = Word::filling(by, victim);
            step!("displace: chosen");
            if self.change(slot, last, word) {
                step!("displace: claimed");
                // ORDERING (E): the mark before the look. Pairs with (G): the owner settles after it gave the mailbox
                // up, and sees the victim, or this is seen here.
                seq_cst_accesses();
                let late = victim.is_some() && self.hot.receiver.0.retired.load(Ordering::SeqCst) != 0;
                return Some(Claim { slot, segment: self.bodies.segment, word, place: FREE, late });
            }
        }
        None
    }

    /// Takes the slot of one's own older package, if it still waits: there is no other. While the newer one is written,
    /// there is neither.
    fn reuse(self, by: Claimant, old: Posted) -> Option<Claim> {
        let word = Word::filling(by, Some(old.as_victim()));
        step!("reuse: chosen");
        let reused = self.change(old.slot, old.word, word);
        step!("reuse: claimed");
        let segment = self.bodies.segment;
        reused.then_some(Claim { slot: old.slot, segment, word, place: old.word, late: false })
    }

    /// Takes one's own older package out, if it still waits; a written claim then stands in its place, also in the
    /// order: with a new ticket each time, a sender that is faster than its receiver would never be received. False: it
    /// no longer waits.
    ///
    /// If `claim` has a victim, its loss has been counted. That of the old one is to be counted after this.
    pub(crate) fn replace(self, claim: &mut Claim, old: Posted) -> bool {
        self.is_of_this(claim.segment);
        // It has been replaced in its own slot already.
        if claim.place != FREE {
            return false;
        }
        let State::Filling { by, .. } = claim.word.state() else { return false };
        // First the loss goes into a word that outlives us, then the package. The old one's slot is freed by one step
        // and not claimed for it: nobody may hold two slots, since mailboxes are as large as one for each sender asks
        // for.
        let marked = Word::filling(by, Some(old.as_victim()));
        if !self.change(claim.slot, claim.word, marked) {
            // Given up meanwhile, or we are held for dead: `publish` finds out.
            return false;
        }
        step!("replace: marked");
        if self.change(old.slot, old.word, FREE) {
            step!("replace: freed");
            claim.word = marked;
            claim.place = old.word;
            return true;
        }
        // It is being received, or was displaced.
        self.change(claim.slot, marked, claim.word);
        step!("replace: unmarked");
        false
    }

    /// Makes a filled slot a package. The caller has counted the displaced one, if there was one.
    #[inline(always)]
    pub(crate) fn publish(&self, claim: Claim, priority: Priority) -> Published {
        self.is_of_this(claim.segment);
        let slot = claim.slot;
        // ORDERING: AcqRel, so that a reader of the counter sees what came before the tickets it counts. A receiver
        // that reads T sees the hints of all packages that one sender published before its package T.
        let ticket = self.hot.ticket.0.fetch_add(1, Ordering::AcqRel);
        step!("publish: ticket");
        // A ticket is taken in any case, since they count the packages. What replaces an older one stands where that
        // one stood.
        let word = Word::ready(priority, if claim.place == FREE { ticket } else { claim.place.ticket() });
        if !self.change(slot, claim.word, word) {
            // ORDERING: Acquire; pairs with the Release of the change that was in the way: if it was `settle`'s, then
            // `retired` is seen below.
            fence(Ordering::Acquire);
            return if self.is_retired() { Published::Retired(claim) } else { Published::Reclaimed };
        }
        step!("publish: ready");
        self.hint(slot);
        step!("publish: hint");
        // ORDERING (E): the word and the hint before the looks at what the receiver says. All are SeqCst, so they stand
        // in this order in the one order of all such accesses. Pairs with (F): of a sender and a receiver that goes to
        // sleep at least one sees the other; with (G): of a sender and a new owner likewise; and with (J): of a sender
        // and a receiver that turns to less important packages likewise.
        seq_cst_accesses();
        let receiver = &self.hot.receiver.0;
        if receiver.retired.load(Ordering::SeqCst) != 0 && self.change(slot, word, claim.word) {
            step!("publish: taken back");
            return Published::Retired(claim);
        }
        // A retired mailbox, and the word is no longer ours: the package was received before, or displaced by a sender
        // that counts it. So it was accepted. With another priority than what it replaces, and of the level, it may
        // stand before what the receiver knows of the level.
        let moved = claim.place != FREE && claim.place.priority() != priority;
        if u32::from(priority.0) + u32::from(moved) > receiver.level.load(Ordering::SeqCst) {
            // ORDERING: Release; pairs with the swap in `heed`, which then sees the hint. No plain store: that of one
            // sender would hide that of another, with the hint it was for.
            self.hot.alert.0.swap(1, Ordering::Release);
            step!("publish: alert");
        }
        let wake = rings(receiver.sleeping.load(Ordering::SeqCst), priority);
        Published::Accepted { posted: Posted { slot, word }, wake }
    }

    /// Gives a claimed slot back unpublished.
    pub(crate) fn abandon(&self, claim: Claim) {
        self.is_of_this(claim.segment);
        step!("abandon: before");
        self.change(claim.slot, claim.word, FREE);
        step!("abandon: freed");
    }

    /// Prefetches the cache lines that the next filler of a slot writes first.
    pub(crate) fn expect_to_fill(&self, slot: usize) {
        prefetch_to_write(self.word(slot));
        self.bodies.expect_to_fill(slot);
    }

    // ---- the receiver ----

    /// Ready becomes Taken, if it still is the package that was seen.
    pub(crate) fn take(&self, slot: usize, seen: Word) -> Option<Taken> {
        step!("take: chosen");
        let word = seen.taken();
        let taken = self.change(slot, seen, word).then_some(Taken { slot, segment: self.bodies.segment, word });
        step!("take: taken");
        taken
    }

    /// Frees a taken slot.
    pub(crate) fn release(&self, taken: Taken) {
        self.is_of_this(taken.segment);
        step!("release: before");
        // Only its receiver frees a taken slot, so this succeeds, whatever word a foreign program wrote there.
        self.change(taken.slot, taken.word, FREE);
        step!("release: freed");
    }

    /// Prefetches the cache lines of a package, all at once, before they are looked at; its word as it will be needed.
    pub(crate) fn expect_package(&self, slot: usize) {
        prefetch_to_write(self.word(slot));
        self.bodies.expect_package(slot);
    }

    /// Frees the slots of dead fillers, and tells `lost` their victims.
    ///
    /// `dead` must never hold a living one for dead. It may hold a dead one for living: this is repeated.
    pub(crate) fn reclaim(&self, mut dead: impl FnMut(Claimant) -> bool, mut lost: impl FnMut(Victim)) -> usize {
        let mut freed = 0;
        for slot in 0..self.count {
            let word = self.load(slot);
            let State::Filling { by, victim } = word.state() else { continue };
            if dead(by) {
                victim.into_iter().for_each(&mut lost);
                step!("reclaim: counted");
                freed += usize::from(self.change(slot, word, FREE));
                step!("reclaim: freed");
            }
        }
        freed
    }

    // ---- a new owner, before it receives ----

    /// Takes over what a dead receiver left: what it had in hand is handed out once more, then dropped (`poison`).
    pub(crate) fn adopt(&self, mut poison: impl FnMut(Priority)) {
        self.awake();
        for slot in 0..self.count {
            let word = self.load(slot);
            if word.state() != State::Taken {
                continue;
            }
            step!("adopt: found");
            if word.is_redelivered() {
                poison(word.priority());
                self.change(slot, word, FREE);
            } else {
                self.change(slot, word, word.redelivered());
            }
            step!("adopt: changed");
        }
    }

    /// For a retired mailbox: passes to `lost` the packages displaced by claims that are still filling. Their senders
    /// could count them here only, where nobody reads any more. They go on as after any other retirement.
    pub(crate) fn settle(&self, mut lost: impl FnMut(Victim)) {
        for slot in 0..self.count {
            let word = self.load(slot);
            if let State::Filling { by, victim: Some(victim) } = word.state() {
                lost(victim);
                step!("settle: counted");
                self.change(slot, word, Word::filling(by, None));
            }
        }
    }
}
