//! Looking for records by stamp: the two around a time, whatever order they were written in.
//!
//! A stamp may be behind the newest one by `late_ns`. So entries are nearly in order, and the greatest stamp so far,
//! which each entry tells, is exactly in order: a binary search finds the first record p that has reached the time.
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
//! An answer is final when no record that is taken from now on could change it: the newest stamp is past the later of
//! the two by `late_ns`, or another epoch has begun. A lost record could have been nearer unless the answer is past all
//! lost ones. So answers depend on stamps, never on arrival.

use crate::stream::ring::{Line, Look, Ring, Stamp, TRIES};

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
    let reached = first(ring, low, end, at);
    // Where this epoch's stamps are now.
    let (newest_ns, is_over) = (newest.newest_ns(), newest.about.stamp.epoch > at.epoch);
    let not_yet = |ns: u64| Answer::NotYet { by_ns: ns.saturating_add(late_ns).saturating_sub(newest_ns) };
    let is_final = |ns: u64| is_over || newest_ns >= ns.saturating_add(late_ns);
    let line = match ring.look(reached) {
        Look::There(line) if reached < end => line,
        Look::Gone => return lost(ring, at),
        _ if newest.about.stamp.epoch == at.epoch => return not_yet(at.ns),
        _ => return Answer::OtherEpoch { newest: newest.about.stamp.epoch },
    };
    if line.about.stamp.epoch != at.epoch {
        return Answer::OtherEpoch { newest: newest.about.stamp.epoch };
    }
    if line.about.before_ns >= at.ns {
        return lost(ring, at);
    }
    let Some((before, after)) = nearest(ring, line, end, at, late_ns) else { return lost(ring, at) };
    let before = match (before, line.about.before_ns) {
        (Some(before), before_ns) if before.about.stamp.ns >= before_ns => Some(before),
        (_, 0) => None,
        (_, before_ns) => has_stamp(ring, low, reached, Stamp { ns: before_ns, ..at }),
    };
    let before = before.filter(|before| floor_ns(ring, at.epoch).is_some_and(|ns| before.about.stamp.ns >= ns));
    match before {
        None if is_final(at.ns) => Answer::BeforeOldest { by_ns: after.about.stamp.ns - at.ns },
        None => not_yet(at.ns),
        Some(_) if !is_final(after.about.stamp.ns) => not_yet(after.about.stamp.ns),
        Some(before) => Answer::Around { before, after },
    }
}

/// The first record from `low` on that has reached this stamp; `end` if none has. What is gone has passed by.
fn first(ring: &Ring<'_>, mut low: u64, mut end: u64, at: Stamp) -> u64 {
    while low < end {
        let middle = low + (end - low) / 2;
        let is_before = match ring.look(middle) {
            Look::There(line) => Stamp { ns: line.newest_ns(), ..line.about.stamp } < at,
            Look::Gone => true,
            Look::NotYet => false,
        };
        if is_before { low = middle + 1 } else { end = middle }
    }
    low
}

/// The record of exactly this stamp which was the newest when it was written.
fn has_stamp(ring: &Ring<'_>, low: u64, end: u64, stamp: Stamp) -> Option<Line> {
    match ring.look(first(ring, low, end, stamp)) {
        Look::There(line) if line.about.stamp == stamp => Some(line),
        _ => None,
    }
}

/// From the first record that has reached the time on: the nearest that is late, if there is one, and the nearest after
/// it. None when the writer has overwritten this.
fn nearest(ring: &Ring<'_>, reached: Line, end: u64, at: Stamp, late_ns: u64) -> Option<(Option<Line>, Line)> {
    let (mut before, mut after) = (None::<Line>, reached);
    for sequence in reached.sequence..end {
        let line = match ring.look(sequence) {
            Look::There(line) => line,
            Look::NotYet | Look::Gone => return None,
        };
        let (stamp, nearest_ns) = (line.about.stamp, after.about.stamp.ns);
        let too_late = line.about.before_ns >= nearest_ns.saturating_add(late_ns);
        if stamp.epoch != at.epoch || too_late && sequence > reached.sequence {
            break;
        }
        if stamp.ns <= at.ns && before.is_none_or(|before| stamp.ns > before.about.stamp.ns) {
            before = Some(line);
        }
        if stamp.ns >= at.ns && stamp.ns < nearest_ns {
            after = line;
        }
    }
    Some((before, after))
}

/// No record of this epoch that is in the ring no more had a stamp above this.
fn floor_ns(ring: &Ring<'_>, epoch: u64) -> Option<u64> {
    let oldest = oldest(ring)?;
    match oldest.about.stamp.epoch {
        of if of == epoch => Some(oldest.about.before_ns),
        of => (of < epoch).then_some(0),
    }
}

/// The oldest record that is there.
pub(super) fn oldest(ring: &Ring<'_>) -> Option<Line> {
    let first = ring.oldest_before(ring.written());
    (first..first + TRIES as u64).find_map(|sequence| match ring.look(sequence) {
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
    use std::sync::atomic::AtomicU64;

    const KEEP: usize = 8;

    /// Writes those that a stream takes, each by its step from the newest before it, and asks after each for each time;
    /// in the end all that were taken are known.
    fn check(steps: &[i64], late_ns: u64, epoch_every: usize) {
        let (written, entries) = (AtomicU64::new(0), std::array::from_fn::<_, KEEP, _>(|_| IndexEntry::default()));
        let seats = [Seat::default()];
        let ring = Ring::new(&written, 0, &entries, &seats);
        let mut progress = Progress::resume(&ring);
        let (mut taken, mut answers) = (Vec::<Stamp>::new(), Vec::new());
        for (at, step) in steps.iter().enumerate() {
            let epoch = (at / epoch_every) as u64;
            let newest_ns = progress.newest().filter(|newest| newest.epoch == epoch).map_or(100, |newest| newest.ns);
            let stamp = Stamp { epoch, ns: newest_ns.saturating_add_signed(*step).max(newest_ns - late_ns) };
            let about = About { stamp, before_ns: 0, written_ns: 0, len_bytes: 0, incarnation: 0 };
            let frame = progress.claim(&ring).unwrap();
            progress.publish(&ring, frame, about, |_, _| ());
            taken.push(stamp);
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
                    let told = (Some(before.about.stamp.ns), Some(after.about.stamp.ns));
                    let (before, after, _) = of(&taken);
                    assert_eq!(told, (before, after), "of {asked:?}: final, and then another");
                }
                Answer::NotYet { .. } => assert!(!is_final, "of {asked:?}: it never comes"),
                Answer::BeforeOldest { .. } => {
                    let is_there = before.is_some_and(|before| lost_ns.is_none_or(|lost| before > lost));
                    assert!(!is_there, "of {asked:?}: {before:?} is there");
                }
                Answer::Empty | Answer::OtherEpoch { .. } => panic!("of {asked:?}: {answer:?} of {there:?}"),
            }
        }
    }

    proptest! {
        #[test]
        fn answers_are_final_and_given_as_soon_as_they_are(
            steps in proptest::collection::vec(-20_i64..25, 1..40),
            late_ns in prop_oneof![Just(0_u64), 1..30_u64],
            epoch_every in 5..60_usize,
        ) {
            check(&steps, late_ns, epoch_every);
        }
    }
}
