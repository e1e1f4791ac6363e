//! A record of a replica of which not all is here: which parts came, and when it is time to ask for the others.
//!
//! ```text
//!  the last part that is expected came ─┐
//!  a part of a newer record came ───────┼─▶ ask ─▶ the last part that was asked for is expected now, and so on
//!  nothing came for an answer's time ───┘          nothing: asked again after that time, twice, four times that time
//! ```
//!
//! While parts come by themselves, with whatever pauses, requests do not count: with time slots a record takes many
//! cycles. Else it ends after [`ROUNDS_MAX`] requests, and when nothing came for the replica's deadline.

use super::settings::ReplicaSettings;
use crate::frame::{ASKED_PARTS_MAX, RecordPart};
use rohrpost_mailbox::{OriginRecord, RecordInfo, Stamp};

/// A record is asked for this often at most: a fifth of all datagrams may be lost, and the rest comes.
pub(super) const ROUNDS_MAX: u32 = 32;
const WORDS: usize = ASKED_PARTS_MAX / 64;

/// What the sender of parts may count sequences from anew.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Life {
    /// Incarnation of the router.
    pub(super) router: u64,
    /// How often that has seen the stream made anew.
    pub(super) generation: u16,
}

impl Life {
    /// Whether the same router says that this ended. As it wraps: earlier by less than half of all numbers.
    pub(super) fn is_before(self, other: Self) -> bool {
        self.router == other.router && (other.generation.wrapping_sub(self.generation) as i16) > 0
    }
}

/// What the parts of a record say of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Arriving {
    pub(super) record: OriginRecord,
    /// When it was written, ns; 0: nobody knows.
    pub(super) written_ns: u64,
    /// How far off that is at most.
    pub(super) error_ns: u32,
    /// Records that its sender had sampled out before it, modulo 2^32.
    pub(super) sampled: u32,
}

impl Arriving {
    pub(super) fn of(part: &RecordPart<'_>) -> Self {
        let record = OriginRecord {
            sequence: part.sequence,
            incarnation: part.incarnation,
            stamp: Stamp { epoch: part.epoch, ns: part.stamp_ns },
            len_bytes: part.len as usize,
        };
        Self { record, written_ns: part.written_ns, error_ns: part.error_ns, sampled: part.sampled }
    }

    /// Whether it is this record of the ring here.
    pub(super) fn is(&self, there: &RecordInfo) -> bool {
        let OriginRecord { sequence, incarnation, stamp, len_bytes } = self.record;
        (sequence, incarnation, stamp, len_bytes) == (there.sequence, there.incarnation, there.stamp, there.len_bytes)
    }
}

/// Room for one record at a time.
#[derive(Default)]
pub(super) struct Gathering {
    is_open: bool,
    pub(super) sequence: u64,
    pub(super) life: Life,
    /// None: no part of it came, all that is known is that it was sent.
    pub(super) arriving: Option<Arriving>,
    /// Parts that came, one bit each.
    came: Box<[u64]>,
    parts: usize,
    missing: usize,
    /// The last part that is expected to come.
    expected: usize,
    /// Behind the last part that came.
    reached: usize,
    /// The longest time between two parts, ns, while new ones come by themselves: with time slots about a cycle.
    gap_ns: u64,
    /// A newer record arrives, so nothing more comes of this one by itself.
    is_passed: bool,
    /// When a part came that was missing, or it was opened, ns.
    came_ns: u64,
    /// Time between parts that come one after the other, smoothed, ns.
    pace_ns: u64,
    asked_ns: u64,
    /// The first of the requests in vain, ns.
    first_asked_ns: u64,
    /// Requests since it came further by itself, and of these since the last missing part came.
    rounds: u32,
    in_vain: u32,
    was_asked: bool,
    /// It is time to ask.
    is_due: bool,
    /// When all of it was here, ns; 0: it is not.
    whole_ns: u64,
}

impl Gathering {
    pub(super) fn new(replica: &ReplicaSettings, part_bytes: usize) -> Self {
        let parts = (replica.shape.record_bytes as usize).div_ceil(part_bytes);
        Self { came: vec![0; parts.div_ceil(64)].into(), ..Self::default() }
    }

    /// Opens it for a record of which nothing is known: its first part is asked for.
    pub(super) fn open_unseen(&mut self, now_ns: u64, sequence: u64, life: Life) {
        self.open(now_ns, sequence, life, 1);
        self.is_due = true;
    }

    /// Opens it for a record of which a part came. Requests for the same record count on.
    pub(super) fn open_seen(&mut self, now_ns: u64, arriving: Arriving, life: Life, part_bytes: usize) {
        let rounds = if self.is_unseen(arriving.record.sequence, life) { self.rounds } else { 0 };
        let parts = arriving.record.len_bytes.div_ceil(part_bytes).max(1);
        let asked = (self.asked_ns, self.first_asked_ns, self.in_vain);
        self.open(now_ns, arriving.record.sequence, life, parts);
        (self.arriving, self.rounds) = (Some(arriving), rounds);
        if rounds > 0 {
            // Of a record that was asked for nothing comes by itself.
            ((self.asked_ns, self.first_asked_ns, self.in_vain), self.expected) = (asked, 0);
            (self.was_asked, self.is_passed) = (true, true);
        }
    }

    fn open(&mut self, now_ns: u64, sequence: u64, life: Life, parts: usize) {
        let mut came = std::mem::take(&mut self.came);
        came[..parts.div_ceil(64)].fill(0);
        let (is_open, missing, expected, came_ns) = (true, parts, parts - 1, now_ns);
        *self = Self { is_open, sequence, life, came, parts, missing, expected, came_ns, ..Self::default() };
    }

    pub(super) fn close(&mut self) {
        self.is_open = false;
    }

    /// Whether it is open for this record.
    pub(super) fn is_of(&self, record: &OriginRecord, life: Life) -> bool {
        self.is_open && self.life == life && self.arriving.is_some_and(|arriving| arriving.record == *record)
    }

    /// Whether it is open for a record of this sequence, and no part of it came.
    pub(super) fn is_unseen(&self, sequence: u64, life: Life) -> bool {
        self.is_open && self.arriving.is_none() && (self.sequence, self.life) == (sequence, life)
    }

    /// Whether all is here.
    pub(super) fn is_whole(&self) -> bool {
        self.is_open && self.missing == 0
    }

    /// Whether all of it has been here for so long.
    pub(super) fn has_waited(&self, now_ns: u64, for_ns: u64) -> bool {
        self.is_whole() && now_ns.saturating_sub(self.whole_ns) >= for_ns
    }

    /// Whether parts of it were asked for.
    pub(super) fn was_asked(&self) -> bool {
        self.was_asked
    }

    /// Whether a part came before.
    pub(super) fn has(&self, index: usize) -> bool {
        self.came[index / 64] & 1 << (index % 64) != 0
    }

    /// A part came that was missing. If it was asked for: how long that took since the first request, ns, and
    /// how many there were.
    pub(super) fn note(&mut self, now_ns: u64, index: usize) -> Option<(u64, u32)> {
        let since_ns = now_ns.saturating_sub(self.came_ns);
        self.came[index / 64] |= 1 << (index % 64);
        self.missing -= 1;
        if self.missing == 0 {
            self.whole_ns = now_ns;
        }
        self.is_due |= index == self.expected;
        if self.in_vain == 0 {
            self.pace_ns = (7 * self.pace_ns + since_ns) / 8;
        }
        let is_answer = self.in_vain > 0 && (index < self.reached || self.is_passed);
        let answer = is_answer.then(|| (now_ns.saturating_sub(self.first_asked_ns), self.in_vain));
        if index >= self.reached && !self.is_passed {
            // It comes further by itself, so what was asked for until now was asked for too early.
            (self.reached, self.rounds) = (index + 1, 0);
            self.gap_ns = self.gap_ns.max(since_ns);
        }
        (self.came_ns, self.in_vain) = (now_ns, 0);
        answer
    }

    /// A newer record arrives: what did not come of this one by now has been lost.
    pub(super) fn is_passed(&mut self) {
        (self.is_due, self.is_passed) = (true, true);
    }

    /// Whether there is no use in asking, or in asking again.
    pub(super) fn is_given_up(&self, now_ns: u64, deadline_ns: u64) -> bool {
        now_ns.saturating_sub(self.came_ns) >= deadline_ns || self.rounds >= ROUNDS_MAX
    }

    /// When that was asked for first of which nothing has come yet, ns, and how often.
    pub(super) fn asked_in_vain(&self) -> Option<(u64, u32)> {
        (self.in_vain > 0).then_some((self.first_asked_ns, self.in_vain))
    }

    /// Whether it is time to ask. An answer takes `answer_ns`.
    pub(super) fn is_due(&self, now_ns: u64, (deadline_ns, answer_ns): (u64, u64)) -> bool {
        // On a slow wire parts come with pauses of their own, and with time slots in one slot a cycle.
        let comes_by_itself = !self.is_passed && self.reached < self.parts;
        let gap_ns = if comes_by_itself { 2 * self.gap_ns } else { 0 };
        let waited_ns = ((answer_ns << self.in_vain.saturating_sub(1).min(8)) + 4 * self.pace_ns).max(gap_ns);
        let is_quiet = now_ns.saturating_sub(self.came_ns.max(self.asked_ns)) >= waited_ns;
        let is_missing = self.is_open && self.missing > 0;
        is_missing && (self.is_due || is_quiet) && !self.is_given_up(now_ns, deadline_ns)
    }

    /// Parts that are missing, by request: the first that it can name, and a bit for each.
    pub(super) fn missing(&self) -> impl Iterator<Item = (usize, [u64; WORDS])> {
        let of_word = move |at: usize| {
            let behind = (64 * (at + 1)).saturating_sub(self.parts);
            !self.came[at] & u64::MAX >> behind
        };
        let words = self.parts.div_ceil(64);
        let all = (0..words).step_by(WORDS).map(move |first| {
            let named = |at: usize| if first + at < words { of_word(first + at) } else { 0 };
            (64 * first, std::array::from_fn(named))
        });
        all.filter(|(_, named)| *named != [0; WORDS])
    }

    /// Parts up to this one were asked for.
    pub(super) fn asked(&mut self, now_ns: u64, last: usize) {
        (self.asked_ns, self.expected, self.is_due) = (now_ns, last, false);
        if self.in_vain == 0 {
            self.first_asked_ns = now_ns;
        }
        self.rounds += 1;
        self.in_vain += 1;
        self.was_asked = true;
    }
}
