//! Joining two views of 1 000 objects, beside sorting the objects of one.

use super::timed::timed;
use super::world::{id, settings};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_team::view::{Kept, Kind, Ledger, ObjectId, Record, Records, State, View};
use rohrpost_team::{Position, Version};
use std::collections::BTreeMap;

const OBSERVERS: u8 = 40;
/// Of each observer: 1 000 in all.
const RECORDS: u32 = 25;
const JOINS: usize = 500;
const NOW_NS: u64 = 1_000_000_000;

pub(super) fn case() -> Case {
    Case::new("views of 1000, join", None, "ns", |settings, subject| {
        let (mut own, other, joined) = (empty(), records(0), records(1));
        own.join(NOW_NS, other);
        let count = settings.count(JOINS);
        let objects = shuffled(&joined);
        let join = || {
            let make = || (own.clone(), joined.clone());
            timed(count, make, |(mut view, records)| {
                view.join(NOW_NS, records);
                view
            })
        };
        let sort = || {
            timed(
                count,
                || objects.clone(),
                |mut objects| {
                    objects.sort_unstable_by_key(|(id, _)| *id);
                    objects
                },
            )
        };
        let contenders =
            [Contender::sampled("rohrpost", join), Contender::sampled("sorting one", sort).beside(at_most(3.0), None)];
        Ok(compare(settings, subject, &contenders))
    })
}

fn empty() -> View {
    View::new(id(99), 1, 7, settings(45).view)
}

/// One of two views: each has the newer record of every second object.
fn records(side: u32) -> Records {
    let ledger = |observer: u8| {
        let record = |number: u32| {
            let counter = 1000 + number + u32::from(number % 2 == side) * 1000;
            let position = Position { x_mm: i32::from(observer) * 10_000, y_mm: number as i32 * 10_000 };
            let version = Version { incarnation: 1, counter };
            let (state, kind, may_be, names) = (State::Seen, Kind::Intruder, None, Vec::new());
            let record = Record { version, state, kind, position, may_be, names };
            (Version { incarnation: 1, counter: number }, Kept { record, seen_ns: 0 })
        };
        Ledger { floor: Version::default(), records: (0..RECORDS).map(record).collect() }
    };
    let ledgers: BTreeMap<_, _> = (1..=OBSERVERS).map(|observer| (id(observer), ledger(observer))).collect();
    Records { from: id(98), map: 7, is_synchro: true, ledgers }
}

/// The objects of a view, in no order.
fn shuffled(records: &Records) -> Vec<(ObjectId, Record)> {
    let of = |(observer, ledger): (&_, &Ledger)| {
        let observer = *observer;
        let kept = ledger.records.clone().into_iter();
        kept.map(move |(number, kept)| (ObjectId { observer, number }, kept.record))
    };
    let mut objects: Vec<_> = records.ledgers.iter().flat_map(of).collect();
    let mixed = |id: &ObjectId| {
        let number = u64::from(id.observer.get()) << 32 | u64::from(id.number.counter);
        number.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29).wrapping_mul(0xbf58_476d_1ce4_e5b9)
    };
    objects.sort_by_key(|(id, _)| mixed(id));
    objects
}
