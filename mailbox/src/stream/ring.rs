//! The core of a stream: how one writer and many readers share a ring of records, with atomics alone.
//!
//! Nothing here maps memory, sleeps or touches a record's bytes (see `segment`, `writer`, `reader`), so that loom can
//! check it as it stands. `writing` has the writer's steps, `lookup` the search by stamp.
//!
//! ```text
//!  index: keep entries                 frames: keep + readers + 1            seats: one a reader
//!  ┌───────────────────────────┐       ┌─────────┐                          ┌───────────────┐
//!  │ 8: frame 2 · stamp · len  │──────▶│ bytes   │◀── written by the writer │ hold: frame 5 │
//!  │ 9: being written          │       ├─────────┤    alone, and never while│ hold: none    │
//!  │ 6: frame 0 · stamp · len  │──────▶│ bytes   │    an entry or a seat    └───────────────┘
//!  └───────────────────────────┘       └─────────┘    names the frame         written by the reader alone
//! ```
//!
//! Record n has entry n modulo `keep`. The word of an entry is the only truth about it: sequence and frame, one store.
//! A record is read in one of two ways:
//!
//! - *copied*: word, copy, word again. If it is the same, the writer had not turned to the frame. The copy races with
//!   the writer, so it is made of atomics.
//! - *held*: the reader writes the frame into its seat, then looks at the word again. If it is the same, the writer
//!   goes round the frame until the seat names it no more. Nothing races, so the bytes are plain memory.
//!
//! A seat names one frame at most, and a frame that is neither in the index nor in a seat always exists: there are
//! `keep + readers + 1`. So the writer waits for nobody, and a stopped reader costs one frame that was there for it.
//!
//! | died | left behind | what fixes it, and how |
//! | --- | --- | --- |
//! | writer, filling a frame | bytes that no entry names | nothing to fix: its successor counts the frame as free |
//! | writer, entry begun | an entry without a frame, the record there before is gone | the successor writes it; readers of the old record are told that they lost it |
//! | writer, entry named its frame | a record that `written` does not count | the record is finished: the successor counts it |
//! | replica's writer, leaving records out | entries of records that never came, beside older ones | the successor leaves out the rest up to the last of them, and goes on behind it |
//! | writer, counted | readers that were not woken | the successor wakes all when it begins |
//! | reader, holding | a seat that names a frame | nothing to fix: the frame is the seat's own room, the next reader there clears it |
//! | reader, asleep | a seat that says so | the writer rings for nobody once, asks whether it lives, and clears it |
//!
//! Orderings. A record is handed over by its word: (A) to (D), as in a cell of its own. (E) and (F) settle sleep
//! against publishing, (G) and (H) holding against reuse.

use crate::step::step;
use crate::stream::omission::LeftOut;
use crate::sync::{AtomicU32, AtomicU64, Ordering, fence};
use std::cmp;

/// Bits of a word that name the frame, plus one; 0: none yet.
const FRAME_BITS: u32 = 20;
pub(super) const FRAME: u64 = (1 << FRAME_BITS) - 1;
/// Most frames of a stream.
pub(crate) const FRAMES_MAX: usize = FRAME as usize;
/// In place of a frame: a replica has no such record, it is gone. Its ring has fewer frames than there may be.
pub(super) const LEFT_OUT: usize = FRAMES_MAX - 1;
/// No stream comes to more records, in two thousand years of a million a second: a larger number is damage. So sums of
/// sequences do not overflow.
pub const SEQUENCE_MAX: u64 = 1 << 56;
/// Most readers of a stream at a time.
pub const STREAM_READERS_MAX: usize = 64;

/// When a record was produced.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Stamp {
    /// Of system time: times of different epochs cannot be compared, and the later epoch is the greater.
    pub epoch: u64,
    /// Nanoseconds of system time; never 0.
    pub ns: u64,
}

/// A record's line in the index. Written by the writer alone.
#[derive(Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct IndexEntry {
    pub(super) word: AtomicU64,
    stamp_ns: AtomicU64,
    /// The greatest stamp of its epoch among all records before it; 0: there is none.
    before_ns: AtomicU64,
    epoch: AtomicU64,
    written_ns: AtomicU64,
    /// At most the shape's record; of a sequence that was left out: why.
    pub(super) len_bytes: AtomicU32,
    incarnation: AtomicU32,
    /// Sequences before it that were left out since the ring began: records that were lost, and that were sampled out.
    pub(super) lost: AtomicU64,
    pub(super) sampled: AtomicU64,
}

/// A reader's line. Written by that reader; the writer clears what a dead one says of its sleep.
#[derive(Debug, Default)]
#[repr(C, align(128))]
pub(crate) struct Seat {
    /// The frame that the writer must go round, plus one; 0: none.
    pub(crate) hold: AtomicU32,
    /// Name of the module that reads, or 0; for tools.
    pub(crate) module: AtomicU32,
    /// Not 0: the reader sleeps, or is about to. Which bell to ring, as the reader chose to write it.
    pub(crate) sleeper: AtomicU64,
    /// Records that were overwritten before this reader came to them.
    pub(crate) passed_over: AtomicU64,
}

/// What is said of a record, besides its sequence.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct About {
    pub(crate) stamp: Stamp,
    pub(crate) before_ns: u64,
    pub(crate) written_ns: u64,
    pub(crate) len_bytes: u64,
    pub(crate) incarnation: u32,
    pub(crate) left_out: LeftOut,
}

/// An entry as it was read, whole.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Line {
    /// Where its entry is.
    at: usize,
    word: u64,
    pub(crate) sequence: u64,
    pub(crate) frame: usize,
    pub(crate) about: About,
}

impl Line {
    /// The greatest stamp of its epoch up to this record.
    pub(crate) fn newest_ns(&self) -> u64 {
        self.about.before_ns.max(self.about.stamp.ns)
    }

    /// The same, with the epoch.
    pub(crate) fn reached(&self) -> Stamp {
        Stamp { ns: self.newest_ns(), ..self.about.stamp }
    }
}

/// What there is of a record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Look {
    /// It is there.
    There(Line),
    /// It is not written yet.
    NotYet,
    /// A newer one has its place.
    Gone,
}

/// The word of an entry.
pub(crate) fn word(sequence: u64, frame: Option<usize>) -> u64 {
    sequence << FRAME_BITS | frame.map_or(0, |frame| frame as u64 + 1)
}

/// How far the word's record is behind (negative) or before the one of this sequence. The word has its low 44 bits: at
/// a million records a second two records 200 days apart look the same.
pub(super) fn ahead(word: u64, sequence: u64) -> i64 {
    ((word >> FRAME_BITS).wrapping_sub(sequence) << FRAME_BITS) as i64 >> FRAME_BITS
}

/// The shared part of a stream, as every process sees it.
#[derive(Clone, Copy)]
pub(crate) struct Ring<'a> {
    /// Records written: the sequence of the next one.
    written: &'a AtomicU64,
    /// The first sequence that was written here; those before it are in no ring any more.
    first: u64,
    entries: &'a [IndexEntry],
    /// Of each entry the greatest stamp of its epoch up to it: a hint where to look by stamp, eight in a cache line.
    /// Nothing is believed of it that the entry does not say as well.
    reached_ns: &'a [AtomicU64],
    seats: &'a [Seat],
}

impl<'a> Ring<'a> {
    /// There is at least one entry, a hint for each, and at most [`STREAM_READERS_MAX`] seats: all come from a checked
    /// shape.
    #[inline]
    pub(crate) fn new(
        written: &'a AtomicU64,
        first: u64,
        (entries, reached_ns): (&'a [IndexEntry], &'a [AtomicU64]),
        seats: &'a [Seat],
    ) -> Self {
        Self { written, first, entries, reached_ns, seats }
    }

    /// Makes each entry one of a record that is gone. For a ring that nobody else sees yet.
    pub(crate) fn format(&self) {
        self.written.store(self.first, Ordering::Relaxed);
        for sequence in self.first.saturating_sub(self.keep())..self.first {
            self.entry(sequence).word.store(word(sequence, None), Ordering::Relaxed);
        }
    }

    /// Records that the ring keeps.
    pub(crate) fn keep(&self) -> u64 {
        self.entries.len() as u64
    }

    /// One for each record, one for each seat, and one to write.
    pub(crate) fn frames(&self) -> usize {
        self.entries.len() + self.seats.len() + 1
    }

    pub(crate) fn first(&self) -> u64 {
        self.first
    }

    pub(crate) fn seats(&self) -> &'a [Seat] {
        self.seats
    }

    fn at(&self, sequence: u64) -> usize {
        (sequence % self.keep()) as usize
    }

    pub(super) fn entry(&self, sequence: u64) -> &'a IndexEntry {
        &self.entries[self.at(sequence)]
    }

    /// A record's entry and its hint, for the writer.
    pub(super) fn place(&self, sequence: u64) -> (&'a IndexEntry, &'a AtomicU64) {
        let at = self.at(sequence);
        (&self.entries[at], &self.reached_ns[at])
    }

    /// The hints of a record and of less than `keep` after it, by sequence.
    pub(super) fn hints_from(&self, low: u64) -> impl Fn(u64) -> u64 + use<'a> {
        // One division for all of them.
        let (hints, begin) = (self.reached_ns, self.at(low));
        move |sequence| {
            let at = begin + (sequence - low) as usize;
            hints[if at < hints.len() { at } else { at - hints.len() }].load(Ordering::Relaxed)
        }
    }

    /// Records ever written, in all rings of this stream. May be late by the one that is being written.
    pub(crate) fn written(&self) -> u64 {
        // ORDERING: Acquire; pairs with the store after publishing: the records that are counted are seen.
        self.written.load(Ordering::Acquire).min(SEQUENCE_MAX)
    }

    pub(super) fn count(&self, written: u64) {
        self.written.store(written, Ordering::Release);
    }

    // ---- readers ----

    /// What there is of a record.
    #[inline]
    pub(crate) fn look(&self, sequence: u64) -> Look {
        let at = self.at(sequence);
        let entry = &self.entries[at];
        // ORDERING: Acquire (B); pairs with (A): the entry, and the frame that it names, are whole.
        let word = entry.word.load(Ordering::Acquire);
        let frame = (word & FRAME) as usize;
        if sequence < self.first {
            return Look::Gone;
        }
        match ahead(word, sequence).cmp(&0) {
            cmp::Ordering::Less => return Look::NotYet,
            cmp::Ordering::Equal if frame == 0 => return Look::NotYet,
            // No writer names a frame that there is not.
            cmp::Ordering::Equal if frame > self.frames() => return Look::Gone,
            cmp::Ordering::Equal => {}
            cmp::Ordering::Greater => return Look::Gone,
        }
        let line = Line { at, word, sequence, frame: frame - 1, about: entry.about() };
        if self.is_there(&line) { Look::There(line) } else { Look::Gone }
    }

    /// Whether the record has not been overwritten since it was looked at: what was copied since then is whole.
    #[inline]
    pub(crate) fn is_there(&self, line: &Line) -> bool {
        // ORDERING (D): what was read of entry and frame before the second look at the word. Pairs with (C): the writer
        // begins the entry anew before it uses the frame again.
        fence(Ordering::Acquire);
        self.entries[line.at].word.load(Ordering::Relaxed) == line.word
    }

    /// Whether there is anything to say of a record but that it is not written yet.
    #[inline]
    pub(crate) fn is_due(&self, sequence: u64) -> bool {
        let word = self.entry(sequence).word.load(Ordering::Relaxed);
        let ahead = ahead(word, sequence);
        ahead > 0 || ahead == 0 && word & FRAME != 0 || sequence < self.first
    }

    /// The newest record; none before the first. A writer that overwrites it at each try has none to show either.
    pub(crate) fn newest(&self) -> Option<Line> {
        let there = |sequence: u64| if let Look::There(line) = self.look(sequence) { Some(line) } else { None };
        (0..TRIES).find_map(|_| {
            let end = self.written();
            // The last ones are left out if the writer of a replica died over them.
            there(end.checked_sub(1)?).or_else(|| {
                let last = (self.oldest_before(end)..end).rev().find(|sequence| self.left_out(*sequence).is_none());
                there(last?)
            })
        })
    }

    /// Where a reader goes on that has found this record gone: the oldest that may still be there.
    pub(crate) fn oldest_after(&self, gone: u64) -> u64 {
        // The place of the gone record is the newer one's at least from when that was begun.
        let newer = ahead(self.entry(gone).word.load(Ordering::Relaxed), gone).max(0) as u64;
        let end = (gone + newer + 1).min(SEQUENCE_MAX).max(self.written());
        self.oldest_before(end).max(gone + 1)
    }

    /// The oldest record when this one is the next to be written.
    pub(crate) fn oldest_before(&self, end: u64) -> u64 {
        end.saturating_sub(self.keep()).max(self.first)
    }

    /// Keeps the writer from a record's frame, until [`Ring::release`]; false when it was overwritten before. The
    /// seat is the caller's, and names no frame.
    #[inline]
    pub(crate) fn hold(&self, seat: usize, line: &Line) -> bool {
        // ORDERING: Release (H), since this may hide the release before it from the writer.
        self.seats[seat].hold.store(line.frame as u32 + 1, Ordering::Release);
        // ORDERING (G): the seat before the second look at the word. Pairs with (E): the writer sees the seat, or the
        // word has changed.
        fence(Ordering::SeqCst);
        step!("hold: said");
        let held = self.entries[line.at].word.load(Ordering::Relaxed) == line.word;
        if !held {
            self.release(seat);
        }
        held
    }

    /// Lets the writer have the frame again.
    #[inline]
    pub(crate) fn release(&self, seat: usize) {
        step!("release: before seat");
        // ORDERING: Release (H); what was read of the frame comes before what the writer writes there. Pairs with (I).
        self.seats[seat].hold.store(0, Ordering::Release);
        step!("release: seat");
    }

    /// Says that the reader of a seat is about to sleep. Look for records after this, then sleep, then [`Ring::awake`].
    pub(crate) fn drowsy(&self, seat: usize, sleeper: u64) {
        self.seats[seat].sleeper.store(sleeper, Ordering::Relaxed);
        // ORDERING (F): `sleeper` before the last look at the word. Pairs with (E): the writer sees the sleeper, or the
        // record is seen.
        fence(Ordering::SeqCst);
    }

    /// Says that it does not sleep.
    pub(crate) fn awake(&self, seat: usize) {
        self.seats[seat].sleeper.store(0, Ordering::Relaxed);
    }

    /// Clears what the dead reader before said. For the new owner of a seat, a process of the module of this name.
    pub(crate) fn sit_down(&self, seat: usize, module: u32) {
        self.awake(seat);
        self.seats[seat].module.store(module, Ordering::Relaxed);
        self.seats[seat].passed_over.store(0, Ordering::Relaxed);
        step!("seat: awake");
        self.release(seat);
    }
}

/// A reader that is passed as often as this has met a writer that turns its whole ring in the meantime.
pub(super) const TRIES: usize = 8;

impl IndexEntry {
    /// What is said in it. Look at the word before and after.
    #[inline]
    pub(super) fn about(&self) -> About {
        let long = |word: &AtomicU64| word.load(Ordering::Relaxed);
        About {
            stamp: Stamp { epoch: long(&self.epoch), ns: long(&self.stamp_ns) },
            before_ns: long(&self.before_ns),
            written_ns: long(&self.written_ns),
            len_bytes: self.len_bytes.load(Ordering::Relaxed).into(),
            incarnation: self.incarnation.load(Ordering::Relaxed),
            left_out: LeftOut { lost: long(&self.lost), sampled: long(&self.sampled) },
        }
    }

    /// Makes this the entry of a record; the writer alone. The word is the last to be written.
    pub(super) fn write(&self, sequence: u64, frame: usize, about: &About) {
        self.word.store(word(sequence, None), Ordering::Relaxed);
        // ORDERING (C): a reader that sees what follows sees that the record before is gone. Pairs with (D).
        fence(Ordering::Release);
        step!("entry: begun");
        let fields = [
            (&self.stamp_ns, about.stamp.ns),
            (&self.before_ns, about.before_ns),
            (&self.epoch, about.stamp.epoch),
            (&self.written_ns, about.written_ns),
            (&self.lost, about.left_out.lost),
            (&self.sampled, about.left_out.sampled),
        ];
        for (field, value) in fields {
            field.store(value, Ordering::Relaxed);
        }
        self.len_bytes.store(about.len_bytes as u32, Ordering::Relaxed);
        self.incarnation.store(about.incarnation, Ordering::Relaxed);
        step!("entry: filled");
        // ORDERING: Release (A); the entry and the frame are whole. Pairs with (B). SeqCst for (E).
        self.word.store(word(sequence, Some(frame)), Ordering::SeqCst);
        step!("entry: published");
    }
}
