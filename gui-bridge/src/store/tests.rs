use super::*;
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
    let fit = BYTES_MAX / large.bytes();
    for round in 0..3 {
        for entity in 0..2 * fit {
            store.put(format!("{entity}").into(), large.clone());
        }
        due(&store);
        store.again(true);
        let inner = store.lock();
        let bytes: usize = inner.entities.iter().map(Entity::bytes).sum();
        assert_eq!(bytes, inner.bytes, "round {round}");
        assert!(bytes <= BYTES_MAX, "{bytes}");
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
fn who_waits_in_vain_can_be_called_off() {
    let store = store(1);
    let looks = std::cell::Cell::new(0);
    let order = store.next(|| {
        looks.set(looks.get() + 1);
        looks.get() > 2
    });
    assert!(order.is_none());
}
