//! Looking for records by stamp: the two around a time, whatever order they were written in.
//!
//! A stamp may be behind the newest one by `late_ns`. So entries are nearly in order, and the greatest stamp so far,
//! which each entry tells, is exactly in order: a search finds the first record p that has reached the time.
//! Before p the greatest stamp is the nearest from below. What is late may lie behind p, but not behind the record
//! from which on nothing so late is taken any more:
//!
//! ```text
//!  late_ns = 20       asked: 45                 p       end of the look
//!  stamp     10   30   20   40   35        60   50   44   70   90
//!  newest    10   30   30   40   40        60   60   60   70   90
//!                           ▲ nearest before p     ▲ nearer ▲ before 44, after 50
//! ```
//!
//! An answer is final when no other stamp that is taken from now on could change it: the newest stamp is past the
//! later of the two by `late_ns`, or another epoch has begun. A lost record could have been nearer unless the answer is
//! past all lost ones. So answers depend on stamps, never on arrival. Of records with one stamp the newest written
//! counts: it corrects those before it, also where one of them was answered already.

use crate::stream::ring::{Line, Look, Ring, Stamp, TRIES};
use std::ops::Range;

/// The answer for a time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Answer {
    /// The nearest records; both are the same when it has this very stamp.
    Around { before: Line, after: Line },
    /// Nothing was written yet.
    Empty,
    /// The nearest before it is in the ring no more, or there never was one; how far it is to the first that is known
    /// to be the nearest.
    BeforeOldest { by_ns: u64 },
    /// What is still to be written may be nearer; how far the newest stamp is from where that ends.
    NotYet { by_ns: u64 },
    /// No two records of the time's epoch are around it, and none will be: the newest record's epoch.
    OtherEpoch { newest: u64 },
}

/// The two records around a time, in a stream that takes stamps so far behind the newest.
pub(crate) fn around(ring: &Ring<'_>, at: Stamp, late_ns: u64) -> Answer {
    let Some(newest) = ring.newest() else { return Answer::Empty };
    let end = newest.sequence + 1;
    let low = ring.oldest_before(end);
    // Where this epoch's stamps are now.
    let (newest_ns, is_over) = (newest.newest_ns(), newest.about.stamp.epoch > at.epoch);
    let not_yet = |ns: u64| Answer::NotYet { by_ns: ns.saturating_add(late_ns).saturating_sub(newest_ns) };
    let is_final = |ns: u64| is_over || newest_ns >= ns.saturating_add(late_ns);
    let line = match first_reached(ring, (low, &newest), at) {
        Look::There(line) => line,
        Look::Gone => return lost(ring, at),
        Look::NotYet if newest.about.stamp.epoch == at.epoch => return not_yet(at.ns),
        Look::NotYet => return Answer::OtherEpoch { newest: newest.about.stamp.epoch },
    };
    if line.about.stamp.epoch != at.epoch {
        return Answer::OtherEpoch { newest: newest.about.stamp.epoch };
    }
    if line.about.before_ns > at.ns {
        return lost(ring, at);
    }
    if line.about.before_ns == at.ns {
        // The first of its stamp is gone; later ones count as well.
        return match newest_of(ring, (low, &newest), at, late_ns) {
            Some(line) if is_final(at.ns) => Answer::Around { before: line, after: line },
            Some(_) => not_yet(at.ns),
            None => lost(ring, at),
        };
    }
    let Some((before, after)) = nearest(ring, line, end, at, late_ns) else { return lost(ring, at) };
    // No lost record could be nearer: the greatest stamp before the line is no less than any of theirs.
    let before = match (before, line.about.before_ns) {
        (Some(before), before_ns) if before.about.stamp.ns >= before_ns => Some(before),
        (_, 0) => None,
        (_, before_ns) => newest_before(ring, low..line.sequence, Stamp { ns: before_ns, ..at }),
    };
    match before {
        None if is_final(at.ns) => Answer::BeforeOldest { by_ns: after.about.stamp.ns - at.ns },
        None => not_yet(at.ns),
        Some(_) if !is_final(after.about.stamp.ns) => not_yet(after.about.stamp.ns),
        Some(before) => Answer::Around { before, after },
    }
}

/// The first record from `low` to the newest that has reached the time; not yet if none has. The search goes by hints,
/// of which eight lie in a cache line. They are right unless the writer passes by or another epoch is in the ring; the
/// record itself says whether it is the one, and if not, all is looked for once more in the entries.
fn first_reached(ring: &Ring<'_>, (low, newest): (u64, &Line), at: Stamp) -> Look {
    if newest.reached() < at {
        return Look::NotYet;
    }
    let hints = ring.hints_from(low);
    let near = || near_guess(&hints, low, newest, at);
    let all = || Left::of(at, low, newest).first(|sequence| Some(Stamp { ns: hints(sequence), ..at }));
    let hinted = ring.look(near().unwrap_or_else(all));
    if let Look::There(line) = &hinted
        && (line.about.stamp.epoch, line.about.before_ns < at.ns, line.newest_ns() >= at.ns) == (at.epoch, true, true)
    {
        return hinted;
    }
    ring.look(Left::of(at, low, newest).first(|sequence| reached(ring, sequence)))
}

/// What a record has reached, or, where one was left out, those before; none: it is gone.
fn reached(ring: &Ring<'_>, sequence: u64) -> Option<Stamp> {
    match ring.look(sequence) {
        Look::There(line) => Some(line.reached()),
        Look::Gone => ring.left_out(sequence).map(|omission| omission.reached),
        Look::NotYet => Some(Stamp { epoch: u64::MAX, ns: u64::MAX }),
    }
}

/// Hints that are looked at one after the other from where the record should be.
const NEAR_MAX: usize = 16;

/// The first record that has reached the time, by hints, if it is near where it should be at one rate of all stamps. A
/// second guess, from the first one's stamp, corrects what differs from that rate on the long way: among 100 000
/// records half to one and a half periods apart it is 1.3 beside the record in the mean, ten at most.
fn near_guess(hints: impl Fn(u64) -> u64, low: u64, newest: &Line, at: Stamp) -> Option<u64> {
    let (last, mut guess, mut reached_ns) = (newest.sequence, low, hints(low));
    let records_per_ns = (last - low) as f64 / newest.newest_ns().checked_sub(reached_ns)? as f64;
    for _ in 0..2 {
        let steps = at.ns as f64 - reached_ns as f64;
        guess = low + ((guess - low) as f64 + steps * records_per_ns).min((last - low) as f64) as u64;
        reached_ns = hints(guess);
    }
    for _ in 0..NEAR_MAX {
        let is_before = reached_ns < at.ns;
        let next = if is_before { guess + 1 } else { guess.checked_sub(1)? };
        if !(low..=last).contains(&next) {
            return (!is_before).then_some(guess);
        }
        reached_ns = hints(next);
        match (is_before, reached_ns < at.ns) {
            (true, false) => return Some(next),
            (false, true) => return Some(guess),
            _ => guess = next,
        }
    }
    None
}

/// Steps of [`Left::first`] that go where a stamp would be if all came at one rate. After them it halves what is left.
const GUESSES_MAX: usize = 8;

/// What is left of a search for the first record that has reached a time.
struct Left {
    at: Stamp,
    /// All before this are before the time.
    low: u64,
    /// This has reached the time.
    end: u64,
    /// The greatest stamp up to the record before `low`, if it is there and of the time's epoch.
    below_ns: Option<u64>,
    /// The same up to `end`.
    above_ns: Option<u64>,
}

impl Left {
    /// From this record on to one that has reached the time.
    fn of(at: Stamp, low: u64, end: &Line) -> Self {
        let above_ns = (end.about.stamp.epoch == at.epoch).then(|| end.newest_ns());
        Self { at, low, end: end.sequence, below_ns: None, above_ns }
    }

    /// The first record that has reached the time, by what each has reached; none: it is gone, so it has passed by.
    ///
    /// Most stamps come at a rate. So the search begins with guesses from the stamps at both ends of what is left:
    /// among 100 000 records of a producer that is not quite regular about six looks find the record, where halving
    /// takes 17. Few guesses are made, so that no stamps cost more than these on top of halving.
    fn first(mut self, reached: impl Fn(u64) -> Option<Stamp>) -> u64 {
        if self.low < self.end {
            self.learn(self.low, reached(self.low));
        }
        for _ in 0..GUESSES_MAX {
            let Some(guess) = self.guess() else { break };
            self.learn(guess, reached(guess));
        }
        while self.low < self.end {
            let half = self.low + (self.end - self.low) / 2;
            self.learn(half, reached(half));
        }
        self.low
    }

    /// This record, one of those that are left, has reached that stamp; none: it is gone.
    fn learn(&mut self, sequence: u64, reached: Option<Stamp>) {
        let ns = reached.filter(|reached| reached.epoch == self.at.epoch).map(|reached| reached.ns);
        if reached.is_none_or(|reached| reached < self.at) {
            (self.low, self.below_ns) = (sequence + 1, ns);
        } else {
            (self.end, self.above_ns) = (sequence, ns);
        }
    }

    /// Where the time would be if the stamps were evenly spaced; none when nothing is left, or one of the two ends has
    /// no stamp to tell.
    fn guess(&self) -> Option<u64> {
        let (below_ns, above_ns) = (self.below_ns?, self.above_ns?);
        let last = self.end.checked_sub(1).filter(|last| *last >= self.low)?;
        // Both differences are exact enough: a guess that is off by one costs a look.
        let part = (self.at.ns - below_ns) as f64 / (above_ns - below_ns) as f64;
        let steps = (part * (self.end - self.low + 1) as f64) as u64;
        Some((self.low - 1).saturating_add(steps).clamp(self.low, last))
    }
}

/// The newest record of exactly this stamp, of which the first has been overwritten.
fn newest_of(ring: &Ring<'_>, (low, newest): (u64, &Line), stamp: Stamp, late_ns: u64) -> Option<Line> {
    let end = newest.sequence + 1;
    let beyond = first_reached(ring, (low, newest), Stamp { ns: stamp.ns.saturating_add(1), ..stamp });
    let passed = if let Look::There(passed) = beyond { Some(passed) } else { None };
    let late = passed.filter(|passed| passed.about.stamp.epoch == stamp.epoch);
    let late = late.and_then(|passed| nearest(ring, passed, end, stamp, late_ns)?.0);
    let before = || newest_before(ring, low..passed.map_or(end, |passed| passed.sequence), stamp);
    late.filter(|line| line.about.stamp == stamp).or_else(before)
}

/// Of the records of exactly this stamp in this part, behind which it is passed, the newest: mostly the last. At most
/// all of the part are looked at, where many came late.
fn newest_before(ring: &Ring<'_>, part: Range<u64>, stamp: Stamp) -> Option<Line> {
    for sequence in part.rev() {
        match ring.look(sequence) {
            Look::There(line) if line.about.stamp == stamp => return Some(line),
            Look::There(line) if line.reached() < stamp => return None,
            // It came late.
            Look::There(_) => {}
            Look::Gone if ring.left_out(sequence).is_some() => {}
            Look::Gone | Look::NotYet => return None,
        }
    }
    None
}

/// From the first record that has reached the time on: the nearest that is late, if there is one, and the nearest after
/// it. None when the writer has overwritten this.
fn nearest(ring: &Ring<'_>, reached: Line, end: u64, at: Stamp, late_ns: u64) -> Option<(Option<Line>, Line)> {
    // It is at the time or after: it is the first record that makes the greatest stamp reach the time.
    let (mut before, mut after) = ((reached.about.stamp.ns == at.ns).then_some(reached), reached);
    let mut newest_ns = reached.newest_ns();
    for sequence in reached.sequence + 1..end {
        // From here on nothing is taken that could be nearer, or of the same stamp.
        if newest_ns > after.about.stamp.ns.saturating_add(late_ns) {
            break;
        }
        let line = match ring.look(sequence) {
            Look::There(line) => line,
            Look::NotYet | Look::Gone if ring.left_out(sequence).is_some() => continue,
            Look::NotYet | Look::Gone => return None,
        };
        let stamp = line.about.stamp;
        if stamp.epoch != at.epoch {
            break;
        }
        if stamp.ns <= at.ns && before.is_none_or(|before| stamp.ns >= before.about.stamp.ns) {
            before = Some(line);
        }
        if stamp.ns >= at.ns && stamp.ns <= after.about.stamp.ns {
            after = line;
        }
        newest_ns = line.newest_ns();
    }
    Some((before, after))
}

/// The oldest record that is there.
pub(super) fn oldest(ring: &Ring<'_>) -> Option<Line> {
    let written = ring.written();
    let there = (ring.oldest_before(written)..written).filter(|sequence| ring.left_out(*sequence).is_none());
    there.take(TRIES).find_map(|sequence| match ring.look(sequence) {
        Look::There(line) => Some(line),
        Look::NotYet | Look::Gone => None,
    })
}

/// The records around the time are not all there any more.
fn lost(ring: &Ring<'_>, at: Stamp) -> Answer {
    match oldest(ring) {
        Some(line) if line.about.stamp.epoch > at.epoch => Answer::OtherEpoch { newest: line.about.stamp.epoch },
        Some(line) => Answer::BeforeOldest { by_ns: line.newest_ns().saturating_sub(at.ns) },
        None => Answer::BeforeOldest { by_ns: 0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::ring::{About, IndexEntry, Seat};
    use crate::stream::writing::Progress;
    use proptest::prelude::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    const KEEP: usize = 8;

    fn about(stamp: Stamp) -> About {
        let (before_ns, written_ns, len_bytes, incarnation, left_out) = Default::default();
        About { stamp, before_ns, written_ns, len_bytes, incarnation, left_out }
    }

    #[derive(Default)]
    struct Memory {
        written: AtomicU64,
        entries: [IndexEntry; KEEP],
        hints: [AtomicU64; KEEP],
        seats: [Seat; 1],
    }

    impl Memory {
        fn ring(&self) -> Ring<'_> {
            Ring::new(&self.written, 0, (&self.entries, &self.hints), &self.seats)
        }
    }

    /// Writes those that a stream takes, each by its step from the newest before it, and asks after each for each time;
    /// in the end all that were taken are known. `lie` is written into all hints, if there is one.
    fn check(steps: &[i64], late_ns: u64, epoch_every: usize, lie: Option<u64>) {
        let memory = Memory::default();
        let ring = memory.ring();
        let mut progress = Progress::resume(&ring);
        let (mut taken, mut answers) = (Vec::<Stamp>::new(), Vec::new());
        for (at, step) in steps.iter().enumerate() {
            let epoch = (at / epoch_every) as u64;
            let newest_ns = progress.newest().filter(|newest| newest.epoch == epoch).map_or(100, |newest| newest.ns);
            let stamp = Stamp { epoch, ns: newest_ns.saturating_add_signed(*step).max(newest_ns - late_ns) };
            let about = about(stamp);
            let frame = progress.claim(&ring).unwrap();
            progress.publish(&ring, frame, about, |_| (), |_, _| ());
            taken.push(stamp);
            for (at, hint) in memory.hints.iter().enumerate().filter(|_| lie.is_some()) {
                hint.store(lie.unwrap_or_default() << at, Ordering::Relaxed);
            }
            for asked in (stamp.ns.saturating_sub(60)..stamp.ns + 30).step_by(3) {
                let asked = Stamp { epoch, ns: asked };
                answers.push((taken.len(), asked, around(&ring, asked, late_ns)));
            }
        }
        for (written, asked, answer) in answers {
            let of = |taken: &[Stamp]| {
                let same = taken.iter().filter(|stamp| stamp.epoch == asked.epoch).map(|stamp| stamp.ns);
                let before = same.clone().filter(|ns| *ns <= asked.ns).max();
                (before, same.clone().filter(|ns| *ns >= asked.ns).min(), same.max().unwrap_or(0))
            };
            let (lost, there) = taken[..written].split_at(written.saturating_sub(KEEP));
            let (before, after, newest_ns) = of(&taken[..written]);
            let is_final = after.is_some_and(|after| newest_ns >= after + late_ns);
            let lost_ns = lost.iter().filter(|stamp| stamp.epoch == asked.epoch).map(|stamp| stamp.ns).max();
            match answer {
                Answer::Around { before, after } => {
                    for line in [before, after] {
                        let same = taken[..written].iter().rposition(|stamp| *stamp == line.about.stamp);
                        assert_eq!(Some(line.sequence as usize), same, "of {asked:?}: the newest of its stamp");
                    }
                    let told = (Some(before.about.stamp.ns), Some(after.about.stamp.ns));
                    let (before, after, _) = of(&taken);
                    assert_eq!(told, (before, after), "of {asked:?}: final, and then another");
                }
                Answer::NotYet { .. } => assert!(!is_final, "of {asked:?}: it never comes"),
                Answer::BeforeOldest { .. } => {
                    let is_exact = |before| before == asked.ns && there.contains(&asked);
                    let is_there = before.is_some_and(|before| {
                        lost_ns.is_none_or(|lost| before > lost || before == lost && is_exact(before))
                    });
                    assert!(!is_there, "of {asked:?}: {before:?} is there");
                }
                Answer::Empty | Answer::OtherEpoch { .. } => panic!("of {asked:?}: {answer:?} of {there:?}"),
            }
        }
    }

    #[test]
    fn of_records_with_one_stamp_the_newest_counts_also_when_the_first_is_overwritten() {
        let memory = Memory::default();
        let ring = memory.ring();
        let mut progress = Progress::resume(&ring);
        let mut write = |ns| {
            let frame = progress.claim(&ring).unwrap();
            progress.publish(&ring, frame, about(Stamp { epoch: 1, ns }), |_| (), |_, _| ());
        };
        let answer = |ns| match around(&ring, Stamp { epoch: 1, ns }, 0) {
            Answer::Around { before, after } => (before.sequence, after.sequence),
            other => panic!("{ns}: {other:?}"),
        };
        [90, 100, 100, 100, 110, 110].into_iter().for_each(&mut write);
        assert_eq!([95, 100, 105, 110].map(answer), [(0, 3), (3, 3), (3, 5), (5, 5)]);
        for sequence in 6..6 + 2 * KEEP as u64 {
            write(120);
            assert_eq!(answer(120), (sequence, sequence));
        }
    }

    proptest! {
        #[test]
        fn answers_are_final_and_given_as_soon_as_they_are(
            steps in proptest::collection::vec(-20_i64..25, 1..40),
            late_ns in prop_oneof![Just(0_u64), 1..30_u64],
            epoch_every in 5..60_usize,
            lie in proptest::option::of(0..200_u64),
        ) {
            check(&steps, late_ns, epoch_every, lie);
        }
    }
}
