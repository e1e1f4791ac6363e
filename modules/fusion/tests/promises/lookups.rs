//! A lookup finds the right two records or the right reason, in whatever order the records came.

use crate::arrival::{Coming, shuffled, streams};
use crate::reference;
use proptest::prelude::*;
use rohrpost_fusion::{Around, History, NoValue, Records, Refused, Stamp};

/// The numbers of the records around a time.
fn found(history: &History<u64>, stamp: Stamp, gap_max_ns: u64) -> Result<[u64; 2], NoValue> {
    Ok(match history.around(stamp, gap_max_ns)? {
        Around::At(position) => [history.read(position).unwrap(); 2],
        Around::Between { before, after, .. } => [before, after].map(|position| history.read(position).unwrap()),
    })
}

fn push(history: &mut History<u64>, record: Coming) -> Result<(), Refused> {
    history.push(record.stamp, record.sequence, record.sequence)
}

#[test]
fn each_reason_says_how_far() {
    let stamp = |ns| Stamp::new(3, ns);
    let mut history = History::new(3, 20);
    assert_eq!(history.at(stamp(5), 100), Err(NoValue::Empty));
    for (sequence, ns, value) in [(0, 100, 1.0), (2, 150, 3.0), (1, 140, 2.0), (3, 300, 4.0)] {
        history.push(stamp(ns), sequence, value).unwrap();
    }
    for (ns, expected) in [
        (139, Err(NoValue::BeforeOldest { by_ns: 1 })),
        (140, Ok(2.0)),
        (145, Ok(2.5)),
        (150, Ok(3.0)),
        (151, Err(NoValue::NotYet { by_ns: 20 })),
        (299, Err(NoValue::NotYet { by_ns: 20 })),
        (300, Err(NoValue::NotYet { by_ns: 20 })),
        (301, Err(NoValue::NotYet { by_ns: 21 })),
    ] {
        assert_eq!(history.at(stamp(ns), 149), expected, "at {ns}");
    }
    assert_eq!(history.push(stamp(280), 9, 0.0), Err(Refused::Late { by_ns: 20, lateness_ns: 20 }));
    assert_eq!(history.push(stamp(300), 3, 0.0), Err(Refused::Repeated { sequence: 3, known: 3 }));
    history.push(stamp(320), 4, 5.0).unwrap();
    assert_eq!(history.at(stamp(200), 149), Err(NoValue::Gap { gap_ns: 150, gap_max_ns: 149 }));
    assert_eq!(history.at(stamp(225), 150), Ok(3.5));
    assert_eq!(history.at(Stamp::new(2, 200), 150), Err(NoValue::OtherEpoch { asked: 2, known: 3 }));
    history.push(Stamp::new(4, 10), 5, 6.0).unwrap();
    assert_eq!(history.at(stamp(225), 150), Err(NoValue::OtherEpoch { asked: 3, known: 4 }));
    assert_eq!(history.push(stamp(330), 6, 7.0), Err(Refused::EarlierEpoch { epoch: 3, newest: 4 }));
    assert_eq!(history.positions(), 0..1, "records of two epochs are never put together");
}

#[test]
fn without_lateness_the_newest_record_answers_at_once() {
    let mut history = History::new(2, 0);
    history.push(Stamp::new(0, 10), 0, 1.0).unwrap();
    assert_eq!(history.at(Stamp::new(0, 10), 0), Ok(1.0));
    assert_eq!(history.at(Stamp::new(0, 12), 0), Err(NoValue::NotYet { by_ns: 2 }));
    // A later record of the same stamp corrects it, for the way to the next one, too.
    history.push(Stamp::new(0, 10), 1, 3.0).unwrap();
    assert_eq!(history.at(Stamp::new(0, 10), 0), Ok(3.0));
    assert_eq!(history.push(Stamp::new(0, 10), 0, 1.0), Err(Refused::Repeated { sequence: 0, known: 1 }));
    assert_eq!(history.push(Stamp::new(0, 9), 2, 1.0), Err(Refused::Late { by_ns: 1, lateness_ns: 0 }));
    history.push(Stamp::new(0, 20), 2, 5.0).unwrap();
    assert_eq!(history.at(Stamp::new(0, 15), 10), Ok(4.0));
    assert_eq!(history.newest().unwrap().value, 5.0);
}

/// A history that is written on while it is asked: each look at a stamp may be the last.
struct Overwritten {
    oldest: std::cell::Cell<u64>,
    looks: std::cell::Cell<u64>,
}

impl Records for Overwritten {
    type Value = f64;

    fn epoch(&self) -> Option<u64> {
        Some(0)
    }

    fn lateness_ns(&self) -> u64 {
        0
    }

    fn positions(&self) -> std::ops::Range<u64> {
        self.oldest.get()..64
    }

    fn stamp_ns(&self, position: u64) -> Option<u64> {
        self.looks.set(self.looks.get().wrapping_sub(1));
        if self.looks.get() == 0 {
            self.oldest.set(40);
        }
        (position >= self.oldest.get()).then_some(10 * position)
    }

    fn read(&self, position: u64) -> Option<f64> {
        self.stamp_ns(position).map(|ns| ns as f64)
    }
}

#[test]
fn what_is_overwritten_during_a_lookup_is_forgotten() {
    let mut answers = [0, 0];
    for looks in 1..30 {
        let records = Overwritten { oldest: 0.into(), looks: looks.into() };
        match records.at(Stamp::new(0, 205), 100) {
            Ok(value) => {
                assert_eq!(value, 205.0);
                answers[0] += 1;
            }
            Err(reason) => {
                assert_eq!(reason, NoValue::BeforeOldest { by_ns: 195 }, "after {looks} looks");
                answers[1] += 1;
            }
        }
    }
    assert!(answers.iter().all(|count| *count > 5), "{answers:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    /// Whatever is asked after each arrival: what is given then stays true, and is what the definition says.
    #[test]
    fn answers_are_right_and_final_in_each_order_of_arrival(
        streams in streams(1, 30), lateness_ns in 0..12u64, gap_max_ns in 0..8u64,
        delays in prop::collection::vec(any::<u64>(), 1..40),
    ) {
        let records = &streams[0];
        let last_epoch = records.last().map_or(1, |last| last.stamp.epoch);
        let mut history = History::new(64, lateness_ns);
        let mut given = Vec::new();
        let mut known: Vec<Coming> = Vec::new();
        for record in shuffled(&streams, &[lateness_ns], &delays, &[0]) {
            prop_assert_eq!(push(&mut history, record), Ok(()));
            known.retain(|known| known.stamp.epoch == record.stamp.epoch);
            known.push(record);
            let newest = known.iter().map(|known| known.stamp).max();
            let newest_numbers: Vec<u64> =
                known.iter().filter(|known| Some(known.stamp) == newest).map(|known| known.sequence).collect();
            for asked_ns in (495..700).chain(995..1_200) {
                let asked = Stamp::new(record.stamp.epoch, asked_ns);
                let answer = found(&history, asked, gap_max_ns);
                let expected = reference::around(&known, lateness_ns, asked_ns, gap_max_ns);
                prop_assert_eq!(&answer, &expected, "at {}", asked_ns);
                // Without lateness, one thing may change it: another record of the newest stamp.
                let may_repeat = |number: &u64| lateness_ns == 0 && newest_numbers.contains(number);
                let is_final = match &answer {
                    Ok(numbers) => !numbers.iter().any(may_repeat),
                    Err(reason) => !matches!(reason, NoValue::NotYet { .. }),
                };
                if is_final && asked.epoch == last_epoch {
                    given.push((asked, answer));
                }
            }
        }
        for (asked, answer) in given {
            prop_assert_eq!(found(&history, asked, gap_max_ns), answer, "given earlier, at {:?}", asked);
        }
    }

    /// A full history forgets the oldest, and gives no other answer than one that remembers all.
    #[test]
    fn a_full_history_forgets_and_never_errs(
        streams in streams(1, 40), lateness_ns in 0..12u64, capacity in 2..10usize,
        delays in prop::collection::vec(any::<u64>(), 1..40),
    ) {
        let (mut small, mut large) = (History::new(capacity, lateness_ns), History::new(64, lateness_ns));
        for record in shuffled(&streams, &[lateness_ns], &delays, &[0]) {
            push(&mut small, record).unwrap();
            push(&mut large, record).unwrap();
            prop_assert!(small.positions().end <= capacity as u64);
            for asked_ns in (495..700).chain(995..1_200) {
                let asked = Stamp::new(record.stamp.epoch, asked_ns);
                let answer = found(&small, asked, u64::MAX);
                if !matches!(answer, Err(NoValue::BeforeOldest { .. } | NoValue::NotYet { .. })) {
                    prop_assert_eq!(answer, found(&large, asked, u64::MAX), "at {}", asked_ns);
                }
            }
        }
    }
}
