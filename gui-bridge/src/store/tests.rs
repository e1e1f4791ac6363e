use super::*;
use rerun::TimePoint;
use rerun::{AsComponents, Points2D, Scalars, TextLog, TimeCell, Transform3D};

const NEVER: fn() -> bool = || false;

fn row(second: i64, what: &dyn AsComponents) -> Row {
    let mut time = TimePoint::default();
    time.insert_cell("t", TimeCell::from_duration_nanos(second * 1_000_000_000));
    Row { time: Some(time), components: what.as_serialized_batches() }
}

fn number(second: i64) -> Row {
    row(second, &Scalars::single(second as f64))
}

fn store(rate_hz: u64) -> Store {
    Store::new(Duration::from_millis(1000 / rate_hz))
}

/// All that is due now: entities with their seconds (−1: always), and layouts.
fn due(store: &Store) -> Vec<(String, i64)> {
    let mut all = Vec::new();
    let now = Instant::now();
    loop {
        let order = store.lock().take(now);
        match order {
            None => return all,
            Some(Order::Layout(_)) => all.push(("layout".into(), -1)),
            Some(Order::Row(entity, row)) => {
                let cell = row.time.and_then(|time| time.get(&"t".into()));
                let second = cell.map_or(-1, |cell| cell.get() / 1_000_000_000);
                all.push((entity.to_string(), second));
            }
        }
    }
}

#[test]
fn the_newest_row_wins_and_the_others_are_counted() {
    let store = store(1);
    for second in 0..100 {
        store.put("a".into(), number(second));
        store.put("b".into(), number(second));
    }
    assert_eq!(due(&store), [("/a".into(), 99), ("/b".into(), 99)]);
    assert_eq!(store.counts(), DrawingCounts { drawn: 2, replaced: 198, ..DrawingCounts::default() });
}

#[test]
fn an_entity_waits_for_its_time_and_another_one_does_not() {
    let store = store(1);
    store.put("a".into(), number(0));
    assert_eq!(due(&store).len(), 1);
    store.put("a".into(), number(1));
    store.put("b".into(), number(1));
    assert_eq!(due(&store), [("/b".into(), 1)], "a was drawn less than a second ago");
    assert!(!store.is_empty());
    let order = store.lock().take(Instant::now() + Duration::from_secs(1));
    assert!(matches!(order, Some(Order::Row(entity, _)) if entity.to_string() == "/a"));
    assert!(store.is_empty());
}

#[test]
fn components_of_one_moment_are_one_row_and_do_not_replace_each_other() {
    let store = store(1);
    store.put("tile".into(), row(0, &Transform3D::from_scale([1.0, 1.0, 1.0])));
    store.put("tile".into(), row(0, &Points2D::new([[1.0, 1.0]])));
    let Some(Order::Row(_, all)) = store.lock().take(Instant::now()) else { panic!("nothing to draw") };
    let is = |archetype: &str| {
        all.components.iter().any(|batch| batch.descriptor.archetype.is_some_and(|name| name.contains(archetype)))
    };
    assert!(is("Transform3D") && is("Points2D"));
    assert_eq!(store.counts().replaced, 0);
}

#[test]
fn a_new_stream_gets_the_last_of_everything() {
    let store = store(1);
    store.arrange(Layout::default());
    store.put("fixed".into(), Row { time: None, ..number(0) });
    store.put("a".into(), number(1));
    store.line("log".into(), row(1, &TextLog::new("hello")));
    let first: Vec<String> = due(&store).into_iter().map(|(entity, _)| entity).collect();
    assert_eq!(first[0], "layout");
    assert_eq!(first.len(), 4);
    store.put("a".into(), number(2));
    for (lines, expected, why) in [
        (
            true,
            &[("/log", 1), ("/a", 2), ("/fixed", -1), ("layout", -1)][..],
            "what waits is newer than what was drawn",
        ),
        (false, &[("/a", 2), ("/fixed", -1), ("layout", -1)][..], "the viewer has seen the lines"),
    ] {
        store.again(lines);
        let mut again = due(&store);
        assert_eq!(again[0].0, "layout");
        again.sort_by_key(|(_, second)| std::cmp::Reverse(*second));
        let expected: Vec<(String, i64)> =
            expected.iter().map(|(entity, second)| ((*entity).into(), *second)).collect();
        let sorted = |mut list: Vec<(String, i64)>| {
            list.sort();
            list
        };
        assert_eq!(sorted(again), sorted(expected), "{why}");
    }
}

#[test]
fn floods_of_lines_and_of_rows_do_not_keep_each_other_waiting() {
    let store = store(1);
    for line in 0..3 * LINES_MAX {
        store.line("log".into(), row(line as i64, &TextLog::new("x")));
        store.put(format!("entity {line}").into(), number(0));
    }
    let counts = store.counts();
    assert_eq!(counts.dropped, 2 * LINES_MAX as u64, "the oldest lines");
    let order = due(&store);
    let line = |at: usize| order[at].0 == "/log";
    assert_ne!(line(0), line(1), "they take turns");
    let lines: Vec<i64> = order.iter().filter(|(entity, _)| entity == "/log").map(|(_, second)| *second).collect();
    assert_eq!(lines, (2 * LINES_MAX as i64..3 * LINES_MAX as i64).collect::<Vec<_>>(), "the newest, in order");
}

#[test]
fn whatever_comes_what_is_held_is_bounded() {
    let store = store(20);
    let points = vec![[0.0f32, 0.0]; 100_000];
    let large = row(0, &Points2D::new(points));
    let fit = (ENTITIES_BYTES_MAX - RESERVE) / large.bytes();
    for round in 0..3 {
        for entity in 0..2 * fit {
            store.put(format!("{entity}").into(), large.clone());
        }
        due(&store);
        store.again(true);
        let inner = store.lock();
        let bytes: usize = inner.entities.iter().map(Entity::bytes).sum();
        assert_eq!(bytes, inner.bytes, "round {round}");
        assert!(bytes <= ENTITIES_BYTES_MAX, "{bytes}");
        assert!(inner.counts.dropped >= fit as u64);
    }
    let many = Store::new(Duration::ZERO);
    for entity in 0..ENTITIES_MAX + 10 {
        many.put(format!("{entity}").into(), number(0));
    }
    assert_eq!(many.counts().dropped, 10);
    many.put("0".into(), number(1));
    assert_eq!(many.counts().dropped, 10, "those that are known go on");
}

/// As many entities as there is room for, each with a row of so many points.
fn full(store: &Store, points: usize) -> usize {
    let large = row(0, &Points2D::new(vec![[0.0f32, 0.0]; points]));
    let mut entity = 0;
    while store.counts().dropped == 0 {
        store.put(format!("tile{entity}").into(), large.clone());
        entity += 1;
    }
    entity - 1
}

#[test]
fn when_there_is_no_room_what_is_known_still_changes() {
    let store = Store::new(Duration::ZERO);
    store.put("pose".into(), number(0));
    let tiles = full(&store, 100_000);
    due(&store);
    // A map that is sent once more while nothing is drawn: more than fits twice.
    let large = row(1, &Points2D::new(vec![[1.0f32, 1.0]; 100_000]));
    for round in 0..3 {
        for tile in 0..tiles {
            store.put(format!("tile{tile}").into(), large.clone());
        }
        store.put("pose".into(), number(1 + round));
    }
    assert_eq!(store.counts().dropped, 1, "the one that was too much");
    let seen = due(&store);
    assert!(seen.contains(&("/pose".into(), 3)), "{seen:?}");
    let second = |(entity, second): &(String, i64)| !entity.starts_with("/tile") || *second == 1;
    assert!(seen.len() == tiles + 1 && seen.iter().all(second), "{seen:?}");
}

#[test]
fn one_entity_that_grows_does_not_push_out_the_others() {
    let store = Store::new(Duration::ZERO);
    store.put("pose".into(), number(0));
    let tiles = full(&store, 50_000);
    let huge = row(1, &Points2D::new(vec![[1.0f32, 1.0]; BYTES_MAX / 8]));
    store.put("tile0".into(), huge);
    assert_eq!(store.counts().dropped, 2, "there is no room for it");
    store.put("pose".into(), number(1));
    let seen = due(&store);
    assert!(seen.contains(&("/pose".into(), 1)) && seen.contains(&("/tile0".into(), 0)), "{seen:?}");
    assert_eq!(seen.len(), tiles + 1);
}

#[test]
fn lines_that_are_long_are_counted_by_what_they_hold() {
    let store = Store::new(Duration::ZERO);
    for line in 0..2 * LINES_MAX {
        store.line("log".into(), row(line as i64, &TextLog::new("x".repeat(LINE_BYTES_MAX / 2))));
        if line == LINES_MAX {
            due(&store);
        }
    }
    let inner = store.lock();
    let all: usize = inner.lines.iter().chain(&inner.lines_kept).map(line_bytes).sum();
    assert_eq!(all, inner.lines_bytes);
    assert!(all <= LINES_BYTES_MAX && all > LINES_BYTES_MAX - LINE_BYTES_MAX, "{all}");
    assert!(inner.lines_kept.is_empty(), "what was drawn goes first");
}

#[test]
fn a_new_stream_has_all_when_what_was_known_has_had_its_turn() {
    let store = Store::new(Duration::ZERO);
    for entity in ["a", "b"] {
        store.put(entity.into(), number(0));
        store.put(entity.into(), Row { time: None, ..number(0) });
    }
    store.line("log".into(), row(0, &TextLog::new("hello")));
    due(&store);
    store.again(true);
    for taken in 0..5 {
        assert!(!store.has_repeated(), "{taken} of 5");
        // A flood of others does not count.
        store.put(format!("new {taken}").into(), number(1));
        store.lock().take(Instant::now()).unwrap();
    }
    for _ in 0..5 {
        store.put("newer".into(), number(2));
        store.lock().take(Instant::now()).unwrap();
    }
    assert!(store.has_repeated() && !store.is_empty(), "the flood goes on");
}

#[test]
fn a_closed_store_gives_all_at_once_and_ends() {
    let store = store(1);
    store.put("a".into(), number(0));
    due(&store);
    store.put("a".into(), number(1));
    store.close();
    assert!(matches!(store.next(NEVER), Some(Order::Row(..))), "its time has not come, but there is no other");
    assert!(store.next(NEVER).is_none());
}

#[test]
fn a_reader_that_waits_in_vain_can_be_called_off() {
    let store = store(1);
    let looks = std::cell::Cell::new(0);
    let order = store.next(|| {
        looks.set(looks.get() + 1);
        looks.get() > 2
    });
    assert!(order.is_none());
}

#[test]
fn large_pictures_stay_within_the_bound_and_the_newest_is_drawn() {
    let store = Store::new(Duration::ZERO);
    let side = 3300;
    let picture = |second: i64| {
        let pixels = vec![second as u8; side * side * 3];
        row(second, &rerun::Image::from_rgb24(pixels, [side as u32, side as u32]))
    };
    for second in 0..6 {
        for camera in ["a", "b", "c"] {
            store.put(camera.into(), picture(second));
            assert!(store.lock().bytes <= ENTITIES_BYTES_MAX, "{second}");
        }
        if second == 3 {
            assert!(!due(&store).is_empty());
        }
    }
    let newest = due(&store);
    assert!(!newest.is_empty() && newest.iter().all(|(_, second)| *second == 5), "{newest:?}");
    assert!(store.counts().dropped > 0, "three do not fit");
}
