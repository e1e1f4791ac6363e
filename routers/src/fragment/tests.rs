use super::*;
use proptest::prelude::*;
use rohrpost_mailbox::Priority;

const PART: usize = 100;
const S: u64 = 1_000_000_000;

struct Cut {
    head: Head,
    first: u64,
    body: Vec<u8>,
}

impl Cut {
    fn new(first: u64, priority: u8, len: usize) -> Self {
        let head = Head { len: len as u16, priority: Priority(priority), ..Head::default() };
        Self { head, first, body: (0..len).map(|at| (at as u64 * 7 + first) as u8).collect() }
    }

    fn part(&self, index: usize) -> Fragment<'_> {
        let (count, offset) = (self.body.len().div_ceil(PART), index * PART);
        let bytes = &self.body[offset..self.body.len().min(offset + PART)];
        let (index, count, offset) = (index as u16, count as u16, offset as u32);
        Fragment { first: self.first, index, count, offset, head: self.head, bytes }
    }
}

/// Takes a fragment; returns `first` of a complete package, and the events of others.
fn take(parts: &mut Reassembly, now_ns: u64, part: &Fragment<'_>) -> (Option<u64>, Vec<(u64, Change)>) {
    let mut changes = Vec::new();
    let whole = parts.take(now_ns, part, || false, |head, _, change| changes.push((head.priority.0.into(), change)));
    (whole.map(|whole| whole.first), changes)
}

#[test]
fn parts_come_in_any_order() {
    let cut = Cut::new(5, 10, 450);
    let mut parts = Reassembly::default();
    for index in [3, 0, 4, 1] {
        assert_eq!(take(&mut parts, 0, &cut.part(index)).0, None);
    }
    let whole = parts.take(0, &cut.part(2), || false, |_, _, _| unreachable!()).unwrap();
    assert_eq!((whole.head, whole.first, whole.body), (cut.head, 5, &cut.body[..]));
    assert!(parts.is_empty());
}

#[test]
fn packages_of_several_levels_come_between_each_other() {
    let (slow, urgent, next) = (Cut::new(5, 10, 300), Cut::new(7, 200, 300), Cut::new(20, 10, 300));
    let mut parts = Reassembly::default();
    for part in [slow.part(0), urgent.part(0), slow.part(1), urgent.part(1), next.part(0), next.part(1)] {
        assert_eq!(take(&mut parts, 0, &part).0, None);
    }
    assert_eq!(parts.len(), 3);
    for (cut, first) in [(&urgent, 7), (&next, 20), (&slow, 5)] {
        let whole = parts.take(0, &cut.part(2), || false, |_, _, _| unreachable!()).unwrap();
        assert_eq!((whole.first, whole.body), (first, &cut.body[..]));
    }
}

#[test]
fn what_is_missing_for_a_second_is_given_up() {
    let cut = Cut::new(5, 10, 300);
    let mut parts = Reassembly::default();
    let mut given_up = Vec::new();
    take(&mut parts, 0, &cut.part(0));
    take(&mut parts, S / 2, &cut.part(1));
    for (now_ns, lost) in [(S, 0), (S * 3 / 2 - 1, 0), (S * 3 / 2, 1), (S * 3, 1)] {
        parts.expire(now_ns, |head, body, change| {
            assert_eq!(body, &cut.body[..PART], "the beginning came");
            given_up.push((*head, change));
        });
        assert_eq!(given_up.len(), lost, "at {now_ns}");
    }
    assert_eq!(given_up, [(cut.head, Change::GivenUp)]);
    assert_eq!(take(&mut parts, S * 3, &cut.part(2)), (None, vec![]), "a straggler begins nothing");
    parts.clear(|_, _, _| unreachable!());
    assert_eq!(
        take(&mut parts, S * 3, &cut.part(2)),
        (None, vec![(10, Change::Began)]),
        "another incarnation's is another"
    );
}

#[test]
fn memory_is_bounded_and_the_least_important_gives_way() {
    let mut parts = Reassembly::default();
    for first in 0..PARTIAL_MAX as u64 {
        take(&mut parts, 0, &Cut::new(first * 10, 100 + first as u8 / 4, 300).part(0));
    }
    for (first, priority, changes, why) in [
        (100, 99, vec![(99, Change::Began), (99, Change::GivenUp)], "the least important itself"),
        (110, 100, vec![(100, Change::Began), (100, Change::GivenUp)], "the oldest of the least important"),
        (120, 200, vec![(200, Change::Began), (100, Change::GivenUp)], "the least important"),
    ] {
        assert_eq!(take(&mut parts, 0, &Cut::new(first, priority, 300).part(0)), (None, changes), "{why}");
        assert_eq!(parts.len(), PARTIAL_MAX);
    }
    assert_eq!(take(&mut parts, 0, &Cut::new(100, 99, 300).part(1)), (None, vec![]), "and its other parts are nothing");
    assert_eq!(take(&mut parts, 0, &Cut::new(0, 100, 300).part(1)), (None, vec![]));
    let last = Cut::new(110, 100, 300);
    take(&mut parts, 0, &last.part(1));
    assert_eq!(take(&mut parts, 0, &last.part(2)).0, Some(110));
}

#[test]
fn a_part_counts_once() {
    let cut = Cut::new(5, 10, 300);
    let mut parts = Reassembly::default();
    for index in [0, 0, 0, 1, 1] {
        assert_eq!(take(&mut parts, 0, &cut.part(index)).0, None);
    }
    assert_eq!(take(&mut parts, 0, &cut.part(2)).0, Some(5));
}

#[test]
fn parts_that_contradict_each_other_are_dropped() {
    let (cut, other) = (Cut::new(5, 10, 300), Cut::new(5, 10, 310));
    let mut parts = Reassembly::default();
    take(&mut parts, 0, &cut.part(0));
    assert_eq!(take(&mut parts, 0, &other.part(3)), (None, vec![]));
    take(&mut parts, 0, &cut.part(1));
    assert_eq!(take(&mut parts, 0, &cut.part(2)).0, Some(5));
}

proptest! {
    #[test]
    fn any_parts_in_any_order_make_what_was_cut(
        packages in prop::collection::vec((any::<u8>(), PART + 1..2000), 1..6),
        order in prop::collection::vec(any::<prop::sample::Index>(), 200),
    ) {
        let numbered = packages.iter().enumerate();
        let cuts: Vec<Cut> = numbered.map(|(n, (p, len))| Cut::new(n as u64 * 50, *p, *len)).collect();
        let count = |cut: &Cut| cut.body.len().div_ceil(PART);
        let mut left: Vec<_> = cuts.iter().flat_map(|cut| (0..count(cut)).map(move |i| (cut, i))).collect();
        let mut parts = Reassembly::default();
        let mut whole = 0;
        for index in order {
            if left.is_empty() {
                break;
            }
            let (cut, i) = left.swap_remove(index.index(left.len()));
            if let Some(made) = parts.take(0, &cut.part(i), || false, |_, _, _| {}) {
                prop_assert_eq!(made.body, &cut.body[..]);
                prop_assert_eq!(made.first, cut.first);
                whole += 1;
            }
        }
        prop_assert!(!left.is_empty() || whole == cuts.len());
    }
}
