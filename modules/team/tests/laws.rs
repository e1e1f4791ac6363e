//! Joining views: the laws of a join, for any records; and what views do that write, lose, repeat and reorder.
//!
//! `ROHRPOST_TEAM_CASES=100000 cargo test -p rohrpost-team --test laws` is the long run.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use rohrpost_team::view::{Kept, Kind, Ledger, Named, ObjectId, RECORDS_MAX, Record, Records, State};
use rohrpost_team::view::{View, ViewSettings};
use rohrpost_team::{Position, RobotId, Version};
use std::collections::BTreeMap;

fn cases() -> ProptestConfig {
    let cases = std::env::var("ROHRPOST_TEAM_CASES").ok().map_or(500, |text| text.parse().unwrap());
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn view(me: u8) -> View {
    let settings = ViewSettings {
        gate_mm: 500,
        sightings: 1,
        certainty_max_age_ns: 10_000_000_000,
        intruder_max_age_ns: 60_000_000_000,
        friend_max_age_ns: 30_000_000_000,
        friend_radius_mm: 300,
        speed_max_mm_s: 1000,
    };
    View::new(id(me), 1, 7, settings)
}

/// Few values, so that records of different messages meet.
fn version(counters: std::ops::Range<u32>) -> impl Strategy<Value = Version> {
    (1..3_u32, counters).prop_map(|(incarnation, counter)| Version { incarnation, counter })
}

fn named() -> impl Strategy<Value = Named> {
    (1..5_u8, version(0..4), version(0..9)).prop_map(|(observer, number, version)| {
        let object = ObjectId { observer: id(observer), number };
        Named { object, version }
    })
}

fn kept() -> impl Strategy<Value = Kept> {
    let state = prop::sample::select(vec![State::Seen, State::Uncertain, State::Empty, State::Gone]);
    let kind = prop::sample::select(vec![Kind::Intruder, Kind::Fake]);
    let position = (0..4_i32, 0..4_i32).prop_map(|(x, y)| Position { x_mm: x * 300, y_mm: y * 300 });
    let may_be = prop::option::of((1..5_u8).prop_map(id));
    let names = vec(named(), 0..3).prop_map(|mut names| {
        names.sort();
        names.dedup();
        names
    });
    (version(4..12), state, kind, position, may_be, names, 0..5_u64).prop_map(
        |(version, state, kind, position, may_be, names, age_s)| {
            let record = Record { version, state, kind, position, may_be, names };
            Kept { record, seen_ns: age_s * 1_000_000_000 }
        },
    )
}

fn records() -> impl Strategy<Value = Records> {
    let ledger = (version(0..10), btree_map(version(0..4), kept(), 0..5)).prop_map(|(floor, mut records)| {
        records.retain(|number, kept| kept.record.version >= floor && kept.record.version >= *number);
        Ledger { floor, records }
    });
    let ledgers = btree_map((1..5_u8).prop_map(id), ledger, 0..4);
    (ledgers, any::<bool>()).prop_map(|(ledgers, is_synchro)| Records { from: id(1), map: 7, is_synchro, ledgers })
}

/// What a robot that saw none of the objects has after these messages.
fn joined(messages: &[&Records]) -> View {
    let mut view = view(99);
    for message in messages {
        view.join(100_000_000_000, (*message).clone());
    }
    view
}

fn all(view: &View) -> (&BTreeMap<RobotId, Ledger>, [u32; 8]) {
    (view.ledgers(), view.digests())
}

/// All of a view as a message: what it would give to another one.
fn whole(view: &View) -> Records {
    let mut ledgers = view.ledgers().clone();
    let kept = ledgers.values_mut().flat_map(|ledger| ledger.records.values_mut());
    kept.for_each(|kept| kept.seen_ns = 100_000_000_000 - kept.seen_ns);
    Records { from: id(99), map: 7, is_synchro: true, ledgers }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_join_is_commutative_associative_and_idempotent(a in records(), b in records(), c in records()) {
        let (ab, ba) = (joined(&[&a, &b]), joined(&[&b, &a]));
        prop_assert_eq!(all(&ab), all(&ba));
        prop_assert_eq!(ab.objects(), ba.objects());
        let bc = joined(&[&b, &c]);
        let (left, right) = (joined(&[&whole(&ab), &c]), joined(&[&a, &whole(&bc)]));
        prop_assert_eq!(all(&left), all(&right));
        let twice = joined(&[&a, &a, &b, &a]);
        prop_assert_eq!(all(&twice), all(&ab));
    }

    #[test]
    fn digests_are_equal_exactly_if_records_are(a in records(), b in records()) {
        let (a, b) = (joined(&[&a]), joined(&[&b]));
        let known = |view: &View| -> Vec<_> {
            let ledgers = view.ledgers().iter().filter(|(_, ledger)| **ledger != Ledger::default());
            ledgers.map(|(observer, ledger)| {
                let records = ledger.records.iter().map(|(number, kept)| (*number, kept.record.clone()));
                let records: Vec<_> = records.collect();
                (*observer, ledger.floor, records)
            }).collect()
        };
        prop_assert_eq!(a.digests() == b.digests(), known(&a) == known(&b));
    }

    #[test]
    fn records_are_read_as_they_were_written(records in records()) {
        let bytes = records.encode();
        prop_assert_eq!(Records::decode(&bytes), Ok(records));
        for len in 0..bytes.len() {
            prop_assert!(Records::decode(&bytes[..len]).is_err());
        }
    }

    /// Three robots see things at any of forty places, see nothing there, make things up and end them. Each message is
    /// lost, or comes once or twice, now or at the very end.
    #[test]
    fn views_that_lose_repeat_and_reorder_are_equal_in_the_end(
        steps in vec((0..3_usize, 0..4_u8, 0..40_i32, 0..4_u8), 1..200)
    ) {
        let mut views = [view(1), view(2), view(3)];
        let mut late = Vec::new();
        for (now_ns, (index, what, place, fate)) in (1_u64..).map(|s| s * 1_000_000_000).zip(steps) {
            let place = Position { x_mm: place * 1000, y_mm: 0 };
            let me = &mut views[index];
            match what {
                0 => me.look(now_ns, &[place], &[], |_| false),
                1 => me.look(now_ns, &[], &[], |seen| seen == place),
                2 => drop(me.add_fake(now_ns, place)),
                _ => me.age(now_ns, &[], |observer| usize::from(observer.get()) == index + 1),
            }
            let Some(message) = me.take_unsent(now_ns) else { continue };
            late.push(message.clone());
            for view in views.iter_mut().take(usize::from(fate)) {
                view.join(now_ns, message.clone());
            }
        }
        let now_ns = 1_000_000_000_000;
        for _ in 0..4 {
            for index in 0..3 {
                let message = views[index].synchro(now_ns, u8::MAX);
                for view in &mut views {
                    view.join(now_ns, message.clone());
                }
            }
        }
        prop_assert_eq!(views[0].digests(), views[1].digests());
        prop_assert_eq!(views[0].digests(), views[2].digests());
        let objects: Vec<ObjectId> = views[0].objects().iter().map(|object| object.id).collect();
        for message in late.iter().rev() {
            let own = &mut views[0];
            prop_assert_eq!(own.join(now_ns, message.clone()), 0, "an old copy changes nothing");
        }
        let again: Vec<ObjectId> = views[0].objects().iter().map(|object| object.id).collect();
        prop_assert_eq!(objects, again);
        prop_assert!(views[0].ledgers().values().all(|ledger| ledger.records.len() <= RECORDS_MAX));
    }
}
