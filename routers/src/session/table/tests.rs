use super::*;
use proptest::prelude::*;

fn range(first: [u8; 4], last: [u8; 4]) -> Range {
    Range { first: Name::from_raw(u32::from_be_bytes(first)), last: Name::from_raw(u32::from_be_bytes(last)) }
}

/// All ranges, each with its host.
fn hosted(table: &RoutingTable) -> Vec<(ClientIndex, Range)> {
    table.ranges.iter().map(|(first, hosted)| (hosted.client, Range { first: *first, last: hosted.last })).collect()
}

/// Registers whatever is of a system.
fn register(table: &mut RoutingTable, client: ClientIndex, system: u8, ranges: &[Range]) -> Result<(), Conflict> {
    let may = |range: &Range| range.first.system() == system && range.last.system() == system;
    table.register(client, RANGES_MAX, may, ranges.iter().copied())
}

#[test]
fn a_name_is_hosted_by_the_range_that_it_lies_in() {
    let mut table = RoutingTable::default();
    let [brain, arm, far] = [0, 1, 2].map(ClientIndex);
    register(&mut table, brain, 1, &[range([1, 0, 0, 0], [1, 199, 255, 255]), range([1, 201, 0, 0], [1, 255, 0, 0])])
        .unwrap();
    register(&mut table, arm, 1, &[range([1, 200, 0, 0], [1, 200, 0, 255])]).unwrap();
    register(&mut table, far, 2, &[range([2, 200, 0, 0], [2, 200, 0, 255])]).unwrap();
    for (name, client, why) in [
        (Name::new(1, 200, 0, 0), Some(arm), "the first of a range"),
        (Name::new(1, 200, 0, 255), Some(arm), "its last"),
        (Name::new(1, 200, 1, 0), None, "behind it nobody"),
        (Name::new(1, 199, 255, 255), Some(brain), "before it another"),
        (Name::new(1, 201, 0, 0), Some(brain), "the second range of one"),
        (Name::new(2, 200, 0, 1), Some(far), "another system"),
        (Name::new(2, 200, 1, 0), None, "nobody"),
        (Name::new(0, 200, 1, 0), None, "before all"),
        (Name::new(255, 200, 1, 0), None, "behind all"),
    ] {
        assert_eq!(table.client_of(name), client, "{name}: {why}");
    }
    assert!(table.systems().eq([1, 2]));
    table.remove(brain);
    assert!(table.client_of(Name::new(1, 199, 0, 0)).is_none() && table.systems().eq([1, 2]));
    table.remove(arm);
    assert!(table.systems().eq([2]) && table.len() == 1);
}

#[test]
fn what_another_hosts_is_refused_whole_or_in_part_and_nothing_changes() {
    let mut table = RoutingTable::default();
    let (one, other) = (ClientIndex(0), ClientIndex(1));
    let held = range([1, 10, 0, 0], [1, 20, 0, 0]);
    register(&mut table, one, 1, &[held]).unwrap();
    register(&mut table, other, 1, &[range([1, 30, 0, 0], [1, 30, 0, 9])]).unwrap();
    for (range, objection, holder) in [
        (held, Objection::Taken, Some(one)),
        (range([1, 11, 0, 0], [1, 11, 0, 9]), Objection::Taken, Some(one)),
        (range([1, 10, 0, 0], [1, 10, 0, 0]), Objection::Taken, Some(one)),
        (range([1, 1, 0, 0], [1, 29, 0, 0]), Objection::Crosses, Some(one)),
        (range([1, 9, 0, 0], [1, 10, 0, 0]), Objection::Crosses, Some(one)),
        (range([1, 20, 0, 0], [1, 21, 0, 0]), Objection::Crosses, Some(one)),
        (range([2, 20, 0, 0], [2, 21, 0, 0]), Objection::NotOwn, None),
        (range([1, 20, 0, 0], [2, 21, 0, 0]), Objection::NotOwn, None),
        (range([1, 41, 0, 0], [1, 40, 0, 0]), Objection::NotOwn, None),
    ] {
        let conflict = Conflict { objection, range, holder };
        assert_eq!(register(&mut table, other, 1, &[range]), Err(conflict), "{range}");
        assert_eq!(table.client_of(Name::new(1, 30, 0, 5)), Some(other), "as it was");
        assert_eq!(table.client_of(Name::new(1, 11, 0, 5)), Some(one), "as it was");
    }
    register(&mut table, other, 1, &[range([1, 40, 0, 0], [1, 40, 0, 9])]).unwrap();
    assert_eq!(table.client_of(Name::new(1, 30, 0, 5)), None, "a registration says all");
    register(&mut table, one, 1, &[held]).unwrap();
}

#[test]
fn of_ones_own_ranges_those_in_others_are_part_of_these_and_none_crosses() {
    let mut table = RoutingTable::default();
    let (one, wide) = (ClientIndex(0), range([1, 10, 0, 0], [1, 20, 0, 0]));
    let inner = range([1, 11, 0, 0], [1, 11, 0, 9]);
    register(&mut table, one, 1, &[inner, wide, wide]).unwrap();
    assert_eq!(hosted(&table), [(one, wide)]);
    let crossing = range([1, 19, 0, 0], [1, 21, 0, 0]);
    let conflict = Conflict { objection: Objection::Crosses, range: crossing, holder: Some(one) };
    assert_eq!(register(&mut table, one, 1, &[crossing, wide]), Err(conflict));
    register(&mut table, one, 1, &[crossing]).unwrap();
    assert_eq!(hosted(&table), [(one, crossing)]);
}

#[test]
fn ranges_beyond_the_room_are_refused() {
    let mut table = RoutingTable::default();
    let module =
        |client: u16, index: usize| Range::module(Name::new(1 + client as u8, (index >> 8) as u8, index as u8, 0));
    let fill = |table: &mut RoutingTable, client: u16, count: usize, room: usize| {
        table.register(ClientIndex(client), room, |_| true, (0..count).map(|index| module(client, index)))
    };
    fill(&mut table, 0, 8, 8).unwrap();
    let conflict = Conflict { objection: Objection::TooMany, range: module(0, 8), holder: None };
    assert_eq!(fill(&mut table, 0, 9, 8), Err(conflict));
    for client in 0..(ENTRIES_MAX / RANGES_MAX) as u16 {
        fill(&mut table, client, RANGES_MAX, RANGES_MAX).unwrap();
    }
    let full = fill(&mut table, 200, 1, RANGES_MAX).map_err(|conflict| conflict.objection);
    assert_eq!((full, table.len()), (Err(Objection::TooMany), ENTRIES_MAX));
    fill(&mut table, 3, RANGES_MAX - 1, RANGES_MAX).unwrap();
    fill(&mut table, 200, 1, RANGES_MAX).unwrap();
}

proptest! {
    /// The slow and simple one keeps a list.
    #[test]
    fn it_does_what_the_slow_and_simple_one_does(
        steps in prop::collection::vec((0u16..4, prop::collection::vec((0u8..12, 0u8..3), 0..5)), 0..12),
        asked in 0u8..15,
    ) {
        let (mut table, mut model) = (RoutingTable::default(), Vec::<(ClientIndex, Range)>::new());
        for (client, ranges) in steps {
            let client = ClientIndex(client);
            let wanted: Vec<Range> = ranges
                .into_iter()
                .map(|(first, length)| range([1, first, 0, 0], [1, first + length, 255, 255]))
                .collect();
            let inside = |range: &Range| wanted.iter().any(|outer| outer != range && outer.holds(range));
            let mut outer: Vec<Range> = wanted.iter().filter(|range| !inside(range)).copied().collect();
            outer.sort_by_key(|range| range.first);
            outer.dedup();
            let crosses = outer.iter().any(|one| outer.iter().any(|other| one != other && one.meets(other)));
            let is_hosted = |range: &Range| model.iter().any(|(other, held)| *other != client && held.meets(range));
            let may = !crosses && !outer.iter().any(is_hosted);
            prop_assert_eq!(register(&mut table, client, 1, &wanted).is_ok(), may);
            if may {
                model.retain(|(other, _)| *other != client);
                model.extend(outer.into_iter().map(|range| (client, range)));
            }
            let mut sorted = model.clone();
            sorted.sort_by_key(|(_, range)| range.first);
            prop_assert_eq!(hosted(&table), sorted);
            prop_assert!(table.systems().eq((!model.is_empty()).then_some(1)));
        }
        let name = Name::new(1, asked, 3, 3);
        let found = model.iter().find(|(_, range)| range.has(name)).map(|(client, _)| *client);
        prop_assert_eq!(table.client_of(name), found);
    }
}
