//! Sets of a matcher are those of the definition, in whatever order records come, and every record is accounted for.

use crate::arrival::{Coming, shuffled, streams};
use crate::reference::{Chosen, Streams};
use proptest::prelude::*;
use rohrpost_fusion::{MatchCounts, MatchInput, Matcher, Refused, Stamp};

fn matcher<const N: usize>(lateness_ns: &[u64], capacity: usize, tolerance_ns: u64) -> Matcher<u64, N> {
    let input = |stream| MatchInput {
        name: format!("stream {stream}"),
        lateness_ns: lateness_ns[stream % lateness_ns.len()],
        capacity,
    };
    Matcher::new(std::array::from_fn(input), tolerance_ns)
}

/// The epoch in which streams end: with a record in it, all before is settled.
const END: Stamp = Stamp::new(9, 1 << 40);

/// Takes all sets, as indices in the streams. The numbers of records are their indices.
fn take<const N: usize>(matcher: &mut Matcher<u64, N>, sets: &mut Vec<Chosen>) {
    while let Some(set) = matcher.next_set() {
        if set[0].stamp != END {
            sets.push(set.iter().map(|record| record.value as usize).collect());
        }
    }
}

fn run<const N: usize>(matcher: &mut Matcher<u64, N>, arrivals: &[Coming]) -> Vec<Chosen> {
    let mut sets = Vec::new();
    for record in arrivals {
        assert_eq!(matcher.push(record.stream, record.stamp, record.sequence, record.sequence), Ok(()));
        take(matcher, &mut sets);
    }
    for stream in 0..N {
        matcher.push(stream, END, u64::MAX, 0).unwrap();
        take(matcher, &mut sets);
    }
    sets
}

fn counts<const N: usize>(matcher: &Matcher<u64, N>) -> Vec<MatchCounts> {
    let counts: Vec<_> = (0..N).map(|stream| matcher.counts(stream)).collect();
    for (stream, its) in counts.iter().enumerate() {
        let gone = its.matched + its.alone + its.passed_over + its.no_room;
        let refused = its.late + its.earlier_epoch + its.repeated;
        assert_eq!(its.pushed, gone + refused + matcher.waiting(stream) as u64, "of stream {stream}: {its:?}");
    }
    counts
}

/// Compares with the definition: in the order of production, and in another one.
fn check<const N: usize>(
    records: &[Vec<Coming>],
    tolerance_ns: u64,
    lateness_ns: &[u64],
    delays: &[u64],
    turns: &[usize],
) -> Result<(), TestCaseError> {
    let reference = Streams { records, tolerance_ns };
    let expected = reference.sets();
    let mut in_order: Vec<Coming> = records.concat();
    in_order.sort_by_key(|record| (record.stamp, record.stream, record.sequence));
    let mut first = matcher::<N>(lateness_ns, 64, tolerance_ns);
    let sets = run(&mut first, &in_order);
    prop_assert_eq!(&sets, &expected, "left: the matcher, right: the definition");
    let mut second = matcher::<N>(lateness_ns, 64, tolerance_ns);
    let again = run(&mut second, &shuffled(records, lateness_ns, delays, turns));
    prop_assert_eq!(&again, &expected, "another order of arrival");
    let (first, second) = (counts(&first), counts(&second));
    prop_assert_eq!(&first, &second);
    for (stream, its) in first.iter().enumerate() {
        prop_assert_eq!((its.no_room, its.late, its.earlier_epoch, its.repeated), (0, 0, 0, 0));
        let matched = its.matched - u64::from(sets.len() as u64 != its.matched);
        prop_assert_eq!(matched, sets.len() as u64, "stream {}", stream);
    }
    each_promise(&reference, &sets)
}

/// The promises one by one, of whatever sets there are.
fn each_promise(reference: &Streams<'_>, sets: &[Chosen]) -> Result<(), TestCaseError> {
    let mut begin = vec![0; reference.records.len()];
    for set in sets {
        let size_ns = reference.size_ns(set);
        prop_assert!(size_ns.is_some_and(|size_ns| size_ns <= reference.tolerance_ns), "{:?}: {:?}", set, size_ns);
        let is_behind = set.iter().zip(&begin).all(|(index, begin)| index >= begin);
        prop_assert!(is_behind, "{:?} uses a record twice, or crosses the set before", set);
        prop_assert!(reference.is_contiguous(&begin, set), "{:?} leaves out a set before it", set);
        let least = reference.least(&begin).and_then(|least| reference.size_ns(&least));
        prop_assert_eq!(size_ns, least, "{:?} is not the least", set);
        begin = set.iter().map(|index| index + 1).collect();
    }
    Ok(())
}

#[test]
fn the_nearest_are_joined_and_the_rest_is_counted() {
    let mut matcher = matcher::<2>(&[0], 16, 30);
    let mut sets = Vec::new();
    for (stream, ns, sequence) in [
        (0, 100, 0),
        (1, 80, 0),
        (1, 110, 1),
        (1, 140, 2),
        (0, 200, 1),
        (1, 170, 3),
        (1, 260, 4),
        (0, 300, 2),
        (1, 290, 5),
        (1, 320, 6),
    ] {
        matcher.push(stream, Stamp::new(1, ns), sequence, sequence).unwrap();
        take(&mut matcher, &mut sets);
    }
    // 100 with 110, 200 with 170; 300 with 290 after the 260, which has no partner.
    assert_eq!(sets, [[0, 1], [1, 3], [2, 5]]);
    let [first, second] = [0, 1].map(|stream| matcher.counts(stream));
    assert_eq!((first.pushed, first.matched, first.alone, first.passed_over), (3, 3, 0, 0));
    assert_eq!((second.pushed, second.matched, second.alone, second.passed_over), (7, 3, 2, 1));
    assert_eq!(matcher.waiting(1), 1);
}

#[test]
fn a_set_waits_for_a_better_record_that_may_still_come() {
    let mut matcher = matcher::<2>(&[0, 10], 4, 20);
    for (stream, ns, sequence) in [(0, 95, 0), (0, 200, 1), (1, 96, 0), (1, 104, 1)] {
        matcher.push(stream, Stamp::new(1, ns), sequence, sequence).unwrap();
        // 96 is 8 before the newest, so 95 may come as long as it is less than 10 before it.
        assert_eq!(matcher.next_set(), None, "after {ns} of stream {stream}");
    }
    matcher.push(1, Stamp::new(1, 95), 2, 2).unwrap();
    assert_eq!(matcher.next_set(), None);
    matcher.push(1, Stamp::new(1, 105), 3, 3).unwrap();
    assert_eq!(matcher.next_set().map(|set| set.map(|record| record.value)), Some([0, 2]));
}

#[test]
fn a_silent_stream_is_named_and_memory_stays_bounded() {
    let mut matcher = matcher::<3>(&[0, 0, 5], 4, 10);
    assert_eq!(matcher.missing(), None, "nothing waits");
    for round in 0..20u64 {
        for stream in [0, 2] {
            matcher.push(stream, Stamp::new(1, 100 * round), round, round).unwrap();
            assert!(matcher.next_set().is_none());
        }
        let missing = matcher.missing().unwrap();
        assert_eq!((missing.stream, missing.name, missing.behind_ns), (1, "stream 1", None));
        assert!((0..3).all(|stream| matcher.waiting(stream) <= 4));
    }
    // What leaves one stream for want of room leaves its partners alone.
    let lost = |matcher: &_| counts(matcher).iter().map(|its| (its.no_room, its.alone)).collect::<Vec<_>>();
    assert_eq!(lost(&matcher), [(16, 0), (0, 0), (0, 16)]);
    // It speaks again: the others' records that are kept are joined.
    matcher.push(1, Stamp::new(1, 1_795), 0, 7).unwrap();
    assert_eq!(matcher.next_set(), None);
    assert_eq!(matcher.missing().unwrap().behind_ns, Some(105));
    matcher.push(1, Stamp::new(1, 2_000), 1, 8).unwrap();
    assert_eq!(matcher.next_set().map(|set| set.map(|record| record.value)), Some([18, 7, 18]));
    assert_eq!(matcher.next_set(), None);
    assert_eq!(lost(&matcher), [(16, 3), (0, 0), (0, 18)]);
    let missing = matcher.missing().unwrap();
    assert_eq!((missing.name, missing.behind_ns), ("stream 0", Some(100)));
}

#[test]
fn eight_streams_are_joined() {
    let mut matcher = matcher::<8>(&[0], 4, 70);
    for stream in (0..8).rev() {
        assert!(matcher.next_set().is_none());
        matcher.push(stream, Stamp::new(1, 1_000 + 10 * stream as u64), 0, stream as u64).unwrap();
    }
    // A later record of the first streams could make a set of less size.
    assert!(matcher.next_set().is_none());
    assert_eq!(matcher.missing().unwrap().stream, 0);
    matcher.push(0, Stamp::new(1, 1_140), 1, 9).unwrap();
    let set = matcher.next_set().unwrap().map(|record| record.value);
    assert_eq!(set, [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(matcher.next_set(), None);
}

#[test]
fn what_a_stream_does_not_take_is_counted() {
    let mut matcher = matcher::<2>(&[10], 4, 10);
    let mut push = |epoch, ns, sequence| matcher.push(0, Stamp::new(epoch, ns), sequence, 0);
    assert_eq!(push(2, 100, 1), Ok(()));
    assert_eq!(push(2, 91, 0), Ok(()));
    assert_eq!(push(2, 90, 2), Err(Refused::Late { by_ns: 10, lateness_ns: 10 }));
    assert_eq!(push(2, 91, 0), Err(Refused::Repeated { sequence: 0, known: 0 }));
    assert_eq!(push(1, 200, 0), Err(Refused::EarlierEpoch { epoch: 1, newest: 2 }));
    let its = counts(&matcher)[0];
    assert_eq!((its.pushed, its.late, its.repeated, its.earlier_epoch), (5, 1, 1, 1));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn two_streams_are_joined_as_the_definition_says(
        records in streams(2, 14), tolerance_ns in 0..12u64, lateness_ns in [0..9u64, 0..9],
        delays in prop::collection::vec(any::<u64>(), 1..40), turns in prop::collection::vec(0..8usize, 1..40),
    ) {
        check::<2>(&records, tolerance_ns, &lateness_ns, &delays, &turns)?;
    }

    #[test]
    fn three_streams_are_joined_as_the_definition_says(
        records in streams(3, 9), tolerance_ns in 0..14u64, lateness_ns in [0..9u64, 0..9, 0..9],
        delays in prop::collection::vec(any::<u64>(), 1..40), turns in prop::collection::vec(0..8usize, 1..40),
    ) {
        check::<3>(&records, tolerance_ns, &lateness_ns, &delays, &turns)?;
    }

    #[test]
    fn four_streams_are_joined_as_the_definition_says(
        records in streams(4, 6), tolerance_ns in 0..16u64, lateness_ns in [0..9u64, 0..9, 0..9, 0..9],
        delays in prop::collection::vec(any::<u64>(), 1..40), turns in prop::collection::vec(0..8usize, 1..40),
    ) {
        check::<4>(&records, tolerance_ns, &lateness_ns, &delays, &turns)?;
    }

    /// With too little room sets are lost, and counted; those that are there are sets.
    #[test]
    fn without_room_records_are_counted_and_sets_stay_sets(
        records in streams(3, 20), tolerance_ns in 0..14u64, lateness_ns in [0..9u64, 0..9, 0..9],
        capacity in 1..5usize,
        delays in prop::collection::vec(any::<u64>(), 1..40), turns in prop::collection::vec(0..8usize, 1..40),
    ) {
        let mut matcher = matcher::<3>(&lateness_ns, capacity, tolerance_ns);
        let sets = run(&mut matcher, &shuffled(&records, &lateness_ns, &delays, &turns));
        counts(&matcher);
        let mut begin = vec![0; 3];
        for set in &sets {
            let size_ns = Streams { records: &records, tolerance_ns }.size_ns(set);
            prop_assert!(size_ns.is_some_and(|size_ns| size_ns <= tolerance_ns));
            prop_assert!(set.iter().zip(&begin).all(|(index, begin)| index >= begin), "{:?} crosses", set);
            begin = set.iter().map(|index| index + 1).collect();
        }
        prop_assert!((0..3).all(|stream| matcher.waiting(stream) <= capacity));
    }
}
