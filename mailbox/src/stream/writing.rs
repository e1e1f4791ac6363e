//! The writer's side of a ring: which frame it fills, how a record becomes one, and which readers it wakes.
//!
//! ```text
//! frame = one that no entry and no seat names │ fill │ entry: word without frame │ (C) │ fields │ (A) word │ count
//!                                                                                  (E) sleepers? ──▶ ring each
//! ```
//! Each of these takes a number of steps bounded by the number of readers. What the writer knows by itself is not
//! shared: a successor works it out from the index.

use crate::step::step;
use crate::stream::left_out::{LeftOut, OmissionCause};
use crate::stream::ring::{
    About, FRAME, IndexEntry, LEFT_OUT, Look, Ring, SEQUENCE_MAX, STREAM_READERS_MAX, Seat, Stamp, ahead,
};
use crate::sync::{Ordering, fence, prefetch_to_write, seq_cst_accesses};

/// What the writer knows.
#[derive(Debug)]
pub(crate) struct Progress {
    /// Sequence of the next record.
    next: u64,
    /// Frames that no entry names: at least one more than there are seats, less those that are being filled.
    free: Vec<u32>,
    /// The greatest stamp of the newest epoch; none before the first record.
    newest: Option<Stamp>,
    /// Sequences that were left out since the ring began.
    left_out: LeftOut,
}

/// A frame to be filled: in no entry and no seat, so the writer alone reaches it. The only one of its frame.
#[must_use = "the frame is lost to this writer unless it is published or given back"]
#[derive(Debug)]
pub(crate) struct Frame(u32);

impl Frame {
    pub(crate) fn number(&self) -> usize {
        self.0 as usize
    }
}

impl Progress {
    /// Goes on where the writer before ended, whichever step that was. For the one writer, before it writes.
    pub(crate) fn resume(ring: &Ring<'_>) -> Self {
        let counted = ring.written().max(ring.first());
        let next = named_end(ring, counted);
        let kept = ring.oldest_before(next)..next;
        let newest = kept.clone().rev().find_map(|sequence| match ring.look(sequence) {
            Look::There(line) => Some(line.reached()),
            Look::NotYet | Look::Gone => {
                ring.left_out(sequence).map(|omission| omission.reached).filter(|stamp| stamp.ns != 0)
            }
        });
        let left_out = kept.clone().rev().find_map(|sequence| ring.left_out_up_to(sequence)).unwrap_or_default();
        if next > counted {
            // Its writer died before it could count it, or among those that it left out before it.
            for sequence in kept.filter(|sequence| ring.entry(*sequence).is_of_older(*sequence)) {
                // Why, the dead one alone knew.
                let before = LeftOut { lost: left_out.lost.saturating_sub(next - sequence), ..left_out };
                leave_out(ring, sequence, newest, (OmissionCause::Lost, before));
            }
            ring.count(next);
            step!("resume: counted");
        }
        // Whatever entry names a frame: a reader may find it there.
        let mut used = vec![false; ring.frames()];
        for frame in (0..ring.keep()).filter_map(|at| ring.entry(at).named_frame(ring.frames())) {
            used[frame as usize] = true;
        }
        // For every frame, once: later ones only come back.
        let mut free = Vec::with_capacity(ring.frames());
        free.extend((0..ring.frames() as u32).filter(|frame| !used[*frame as usize]));
        // ORDERING (E): what the writer before did to the index, before the looks at the seats. Pairs with (G).
        fence(Ordering::SeqCst);
        Self { next, free, newest, left_out }
    }

    /// Sequence of the next record.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// The greatest stamp of the newest epoch.
    pub(crate) fn newest(&self) -> Option<Stamp> {
        self.newest
    }

    /// A frame to fill. There always is one, if none is being filled: a seat names one frame at most, and is looked at
    /// once.
    pub(crate) fn claim(&mut self, ring: &Ring<'_>) -> Option<Frame> {
        // ORDERING: Acquire (I); pairs with (H): a reader that held a frame has read it. SeqCst for (E).
        let held = |seat: &Seat| seat.hold.load(Ordering::SeqCst);
        // The last to become free is the nearest in the caches, and mostly nobody holds it.
        let last = self.free.last()? + 1;
        if ring.seats().iter().all(|seat| held(seat) != last) {
            return self.free.pop().map(Frame);
        }
        let mut all_held = [0; STREAM_READERS_MAX];
        all_held.iter_mut().zip(ring.seats()).for_each(|(into, seat)| *into = held(seat));
        let all_held = &all_held[..ring.seats().len()];
        let at = self.free.iter().rposition(|frame| !all_held.contains(&(frame + 1)))?;
        Some(Frame(self.free.swap_remove(at)))
    }

    /// Gives a frame back that does not become a record.
    pub(crate) fn give_back(&mut self, frame: Frame) {
        self.free.push(frame.0);
    }

    /// Leaves out all up to this sequence, which is the next record's: the last `sampled` of them on purpose, the
    /// others were lost. Readers are told so. For a replica. A number of steps bounded by what the ring keeps.
    pub(crate) fn skip_to(&mut self, ring: &Ring<'_>, sequence: u64, sampled: u64) {
        let (next, so_far) = (self.next, self.left_out);
        let first_sampled = sequence.saturating_sub(sampled).max(next);
        // What is left out before one of them.
        let before = |at: u64| LeftOut {
            lost: so_far.lost.saturating_add(at.min(first_sampled).saturating_sub(next)),
            sampled: so_far.sampled.saturating_add(at.saturating_sub(first_sampled)),
        };
        for at in next.max(sequence.saturating_sub(ring.keep()))..sequence {
            let cause = if at < first_sampled { OmissionCause::Lost } else { OmissionCause::Sampled };
            self.free.extend(leave_out(ring, at, self.newest, (cause, before(at))));
        }
        (self.next, self.left_out) = (next.max(sequence), before(sequence));
        // ORDERING (E): the new words before the looks at the seats, when one of these frames is claimed.
        seq_cst_accesses();
    }

    /// Makes a filled frame the next record, and calls `wake` for each seat that says that its reader sleeps; `expect`
    /// before, for the frame that the next record will mostly have. `about.before_ns` and `about.left_out` are written
    /// here.
    pub(crate) fn publish(
        &mut self,
        ring: &Ring<'_>,
        frame: Frame,
        about: About,
        expect: impl Fn(usize),
        mut wake: impl FnMut(&Seat, u64),
    ) -> u64 {
        let sequence = self.next;
        let before_ns = self.newest.filter(|newest| newest.epoch == about.stamp.epoch).map_or(0, |newest| newest.ns);
        let newest = Stamp { ns: before_ns.max(about.stamp.ns), ..about.stamp };
        let (entry, hint) = ring.place(sequence);
        // The record that loses its entry.
        let old = sequence.checked_sub(ring.keep()).and_then(|old| entry.frame(old, ring.frames()));
        // Readers have lines of both, and it takes as long as all of a write until they are here.
        old.into_iter().for_each(|frame| expect(frame as usize));
        prefetch_to_write(ring.entry(sequence + 1));
        step!("publish: filled");
        // ORDERING: Relaxed; a hint is believed only as far as the entry says the same.
        hint.store(newest.ns, Ordering::Relaxed);
        entry.write(sequence, frame.number(), &About { before_ns, left_out: self.left_out, ..about });
        self.next = sequence + 1;
        ring.count(self.next);
        step!("publish: counted");
        self.newest = Some(newest);
        self.free.extend(old);
        // ORDERING (E): the new word before the looks at the seats: at their sleepers now, at their holds when the next
        // frame is claimed. All are SeqCst, so they stand in one order with the fences of (F) and (G), with which
        // they pair. What is written into the old record's frame from here on comes after (C) already.
        seq_cst_accesses();
        for seat in ring.seats() {
            let sleeper = seat.sleeper.load(Ordering::SeqCst);
            if sleeper != 0 {
                step!("publish: before wake");
                wake(seat, sleeper);
            }
        }
        sequence
    }
}

/// Behind the last record that an entry names, and not before one that was begun: what a writer counts, or, if it died
/// before it could, more. Readers may have been told by the entries that all up to there is gone.
fn named_end(ring: &Ring<'_>, counted: u64) -> u64 {
    let end = |at| {
        let (sequence, is_named) = ring.entry(at).says(counted)?;
        (sequence % ring.keep() == at).then_some(sequence + u64::from(is_named))
    };
    (0..ring.keep()).filter_map(end).fold(counted, u64::max)
}

/// Makes this an entry of a record that never came: the frame that it named, of a record that may be more than a turn
/// of the ring behind. `newest` is what the stream had reached; then why it never came, and what was left out before.
fn leave_out(
    ring: &Ring<'_>,
    sequence: u64,
    newest: Option<Stamp>,
    (cause, left_out): (OmissionCause, LeftOut),
) -> Option<u32> {
    let stamp = newest.unwrap_or(Stamp { epoch: 0, ns: 0 });
    let len_bytes = IndexEntry::len_of(cause);
    let about = About { stamp, before_ns: stamp.ns, written_ns: 0, len_bytes, incarnation: 0, left_out };
    let (entry, hint) = ring.place(sequence);
    let old = entry.named_frame(ring.frames());
    hint.store(stamp.ns, Ordering::Relaxed);
    entry.write(sequence, LEFT_OUT, &about);
    old
}

/// What the writer asks of an entry, which it alone changes.
impl IndexEntry {
    /// The frame of the record of this sequence; none if this is another's entry, or its writer died over it.
    fn frame(&self, sequence: u64, frames: usize) -> Option<u32> {
        let is_its = ahead(self.word.load(Ordering::Relaxed), sequence) == 0;
        self.named_frame(frames).filter(|_| is_its)
    }

    /// The frame of whichever record has this entry.
    fn named_frame(&self, frames: usize) -> Option<u32> {
        let word = self.word.load(Ordering::Relaxed);
        // Of a damaged file any number is possible.
        ((word & FRAME) as u32).checked_sub(1).filter(|frame| (*frame as usize) < frames)
    }

    /// The sequence of its word, as one near `counted`, and whether the record is there or said to be left out.
    fn says(&self, counted: u64) -> Option<(u64, bool)> {
        // ORDERING: Acquire (B), as in `look`.
        let word = self.word.load(Ordering::Acquire);
        let sequence = counted.checked_add_signed(ahead(word, counted))?;
        (sequence < SEQUENCE_MAX).then_some((sequence, word & FRAME != 0))
    }

    /// Whether it has an older record than this one, which has the same place.
    fn is_of_older(&self, sequence: u64) -> bool {
        ahead(self.word.load(Ordering::Relaxed), sequence) < 0
    }
}

impl Seat {
    /// Clears what a dead reader said of its sleep, unless another reader has said something since.
    pub(crate) fn forget(&self, sleeper: u64) {
        let _ = self.sleeper.compare_exchange(sleeper, 0, Ordering::Relaxed, Ordering::Relaxed);
    }
}
