//! The analysis against the simulation.

use super::mistakes::{Mistake, with};
use super::response::{Ahead, Never, Stream, Supply, Window, worst};
use super::simulation::{Play, Sent, System};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, TestRunner};

const US: u64 = 1_000;
const MS: u64 = 1_000_000;
const LONGEST_NS: u64 = 1_500 * MS;
const BENDS_NS_S: u64 = 1_250_000;

/// Tables of one to three cycles with one or two slots each, and one to five streams of three levels to two peers.
fn systems() -> impl Strategy<Value = System> {
    let cycle = prop_oneof![Just(2 * MS), Just(5 * MS), Just(10 * MS)];
    let slots = prop::collection::vec((0..3_u64, 0..2_u64, 150..900_u64), 1..5);
    let flow = (1..60_u64, any::<bool>(), 0..3_u8, 0..2_u8, prop_oneof![4 => 1..110_u64, 1 => 200..500_u64]);
    (cycle, 1..4_u64, slots, prop::collection::vec(flow, 1..6), 0..120_u64).prop_map(
        |(cycle_ns, cycles, slots, flows, said_us)| {
            let mut windows: Vec<Window> = Vec::new();
            for (cycle, half, sends_us) in slots {
                let begin_ns = cycle % cycles * cycle_ns + half * cycle_ns / 2;
                let window = Window { begin_ns, sends_ns: sends_us * US, slot: 0 };
                if windows.iter().all(|other| other.begin_ns != begin_ns) {
                    windows.push(window);
                }
            }
            windows.sort_by_key(|window| window.begin_ns);
            let flows = flows.into_iter().map(|(period, is_round, level, peer, size_us)| Sent {
                // Round periods meet slots again and again in the same way, the others in all ways.
                period_ns: period * MS + if is_round { 0 } else { 137_911 },
                level,
                peer,
                size_ns: size_us * US,
            });
            System {
                supply: Supply {
                    windows,
                    repeats_ns: cycles * cycle_ns,
                    said_ns: said_us * US,
                    taken_before_ns: 50 * US,
                    late_ns: 20 * US,
                    bends_ns_s: BENDS_NS_S,
                },
                flows: flows.collect(),
                head_ns: 10 * US,
                least_ns: 15 * US,
                most_ns: 125 * US,
            }
        },
    )
}

fn stream(system: &System, flow: &Sent) -> Stream {
    let datagrams = system.datagrams_ns(flow);
    let end_ns = *datagrams.last().unwrap();
    Stream {
        period_ns: flow.period_ns,
        takes_ns: datagrams.iter().sum(),
        datagrams: datagrams.len() as u64,
        largest_ns: *datagrams.iter().max().unwrap(),
        end_ns,
        last_ns: if system.is_whole(flow) { system.most_ns } else { end_ns },
    }
}

/// The bound of a stream by the analysis.
fn bound(system: &System, index: usize) -> Result<u64, Never> {
    let own = &system.flows[index];
    let others = system.flows.iter().enumerate().filter(|(other, flow)| *other != index && flow.level <= own.level);
    let others: Vec<_> = others
        .map(|(_, flow)| {
            let is_beside = flow.level == own.level && flow.peer == own.peer;
            (stream(system, flow), if is_beside { Ahead::Earlier } else { Ahead::Always })
        })
        .collect();
    worst(&system.supply, &stream(system, own), &others, LONGEST_NS).map(|worst| worst.latency_ns)
}

/// The longest latency of each stream in several runs; packages begin just after each slot took its packages. In every
/// other pair of seeds parts of replicas leave behind them.
fn played(system: &System, seeds: u64) -> Vec<u64> {
    let mut longest = vec![0; system.flows.len()];
    let supply = &system.supply;
    for window in &supply.windows {
        for seed in 0..seeds {
            // Each stream is once the last of those that come at once.
            let (looks_again, replicas) = (seed % 2 == 1, seed / 2 % 2 == 1);
            let play = Play { from_ns: window.begin_ns, seed, looks_again, replicas, rounds: rounds(supply) };
            for turn in 0..if seed == 0 { system.flows.len() } else { 1 } {
                let mut turned = system.clone();
                turned.flows.rotate_left(turn);
                let mut found = turned.play(play).worst;
                found.rotate_right(turn);
                longest.iter_mut().zip(found).for_each(|(longest, found)| *longest = (*longest).max(found));
            }
        }
    }
    longest
}

/// So many rounds of the table are played.
fn rounds(supply: &Supply) -> u64 {
    (400 * MS).div_ceil(supply.repeats_ns)
}

/// The fewest parts of replicas that left in several runs.
fn parts_played(system: &System) -> u64 {
    let (from_ns, rounds) = (system.supply.windows[0].begin_ns, rounds(&system.supply));
    let play = |seed: u64| Play { from_ns, seed, looks_again: seed % 2 == 1, replicas: true, rounds };
    (0..4).map(|seed| system.play(play(seed)).parts).min().unwrap_or(0)
}

/// What the analysis promises of parts of replicas, if fewer left.
fn lacking_parts(system: &System, parts: u64) -> Option<String> {
    let streams: Vec<_> = system.flows.iter().map(|flow| stream(system, flow)).collect();
    let left = system.supply.leaves(&streams, system.most_ns);
    let time_ns = rounds(&system.supply) * system.supply.repeats_ns;
    let promised = (u128::from(left) * u128::from(time_ns) / 1_000_000_000_000) as u64;
    // Of each stream one package more may come in a time than the time has periods.
    let slack = 2 + streams.iter().map(|stream| stream.datagrams).sum::<u64>();
    (parts + slack < promised).then(|| format!("{parts} parts left, at least {promised} were promised"))
}

/// The first stream that exceeds its bound.
fn broken_promise(system: &System, longest: &[u64]) -> Option<String> {
    longest.iter().enumerate().find_map(|(index, longest_ns)| match bound(system, index) {
        Ok(bound_ns) if bound_ns < *longest_ns => Some(format!("flow {index}: {longest_ns} ns, bound {bound_ns} ns")),
        _ => None,
    })
}

proptest! {
    #![proptest_config(Config { cases: 1000, ..Config::default() })]

    #[test]
    fn no_package_takes_longer_than_its_bound_and_parts_have_what_is_left(system in systems(), seed in 1..u64::MAX) {
        let mut longest = played(&system, 4);
        let rounds = rounds(&system.supply);
        for (looks_again, replicas) in [(true, false), (true, true), (false, false), (false, true)] {
            let found = system.play(Play { from_ns: 0, seed, looks_again, replicas, rounds }).worst;
            longest.iter_mut().zip(found).for_each(|(longest, found)| *longest = (*longest).max(found));
        }
        prop_assert_eq!(broken_promise(&system, &longest), None);
        prop_assert_eq!(lacking_parts(&system, parts_played(&system)), None);
    }
}

/// Values beyond those in files, and the limits of files.
fn extremes() -> impl Strategy<Value = u64> {
    prop_oneof![Just(1), Just(2), 1..1000_u64, 1..3 * MS, Just(u64::MAX / 2), u64::MAX - 5..=u64::MAX]
}

proptest! {
    #[test]
    fn whatever_is_asked_the_answer_comes_without_overflow(
        streams in prop::collection::vec((extremes(), 1..1000 * MS, 1..1000_u64, any::<bool>()), 1..6),
        sends_us in 1..900_u64,
        repeats_ms in prop_oneof![Just(1_u64), Just(5), Just(64_000)],
    ) {
        let windows = vec![Window { begin_ns: 50 * US, sends_ns: sends_us * US, slot: 0 }];
        let (repeats_ns, said_ns) = (repeats_ms * MS, 20 * US);
        let (taken_before_ns, late_ns, bends_ns_s) = (50 * US, 20 * US, BENDS_NS_S);
        let supply = Supply { windows, repeats_ns, said_ns, taken_before_ns, late_ns, bends_ns_s };
        let streams: Vec<_> = streams
            .into_iter()
            .map(|(period_ns, takes_ns, datagrams, always)| {
                let end_ns = takes_ns.div_ceil(datagrams);
                let stream =
                    Stream { period_ns, takes_ns, datagrams, largest_ns: end_ns, end_ns, last_ns: end_ns };
                (stream, if always { Ahead::Always } else { Ahead::Earlier })
            })
            .collect();
        if let Ok(worst) = worst(&supply, &streams[0].0, &streams[1..], LONGEST_NS) {
            // A package with the longest wait has begun to leave by then.
            prop_assert!(worst.latency_ns <= LONGEST_NS + repeats_ns + streams[0].0.takes_ns, "{worst:?}");
        }
    }
}

/// The same systems in each run.
fn some_systems(count: usize) -> Vec<System> {
    let mut runner = TestRunner::deterministic();
    (0..count).map(|_| systems().new_tree(&mut runner).unwrap().current()).collect()
}

#[test]
fn each_mistake_in_the_analysis_is_seen() {
    let play = |system: System| (played(&system, 2), parts_played(&system), system);
    let systems: Vec<_> = some_systems(1500).into_iter().map(play).collect();
    let is_seen = |(longest, parts, system): &&(Vec<u64>, u64, System)| {
        broken_promise(system, longest).is_some() || lacking_parts(system, *parts).is_some()
    };
    let seen = |mistake| with(mistake, || systems.iter().filter(is_seen).count());
    assert_eq!(seen(None), 0);
    for mistake in Mistake::ALL {
        let count = seen(Some(mistake));
        println!("{mistake:?}: seen in {count} of {} systems", systems.len());
        assert!(count > 0, "{mistake:?} was not noticed");
    }
}

#[test]
fn parts_leave_not_much_oftener_than_promised() {
    let mut shares = Vec::new();
    for system in some_systems(1000) {
        let streams: Vec<_> = system.flows.iter().map(|flow| stream(&system, flow)).collect();
        let left = system.supply.leaves(&streams, system.most_ns);
        let time_ns = rounds(&system.supply) * system.supply.repeats_ns;
        let left = left as f64 * time_ns as f64 / 1e12;
        if left > 0.0 {
            shares.push(parts_played(&system) as f64 / left);
        }
    }
    shares.sort_by(f64::total_cmp);
    let median = shares[shares.len() / 2];
    println!("parts over those promised, in {} systems: p50 {median:.2}", shares.len());
    assert!(shares.len() > 300 && median < 2.0, "{median} in {}", shares.len());
}

#[test]
fn bounds_are_not_far_above_what_happens() {
    let mut ratios = Vec::new();
    for system in some_systems(1000) {
        for (index, longest_ns) in played(&system, 6).into_iter().enumerate() {
            if let Ok(bound_ns) = bound(&system, index) {
                ratios.push(bound_ns as f64 / longest_ns as f64);
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| ratios[(share * (ratios.len() - 1) as f64) as usize];
    println!(
        "{} bounds over the longest seen: p50 {:.2}, p99 {:.2}, max {:.2}",
        ratios.len(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
    assert!(ratios.len() > 1000, "most systems have bounds");
    assert!(at(0.5) < 1.2 && at(0.99) < 3.0, "p50 {}, p99 {}", at(0.5), at(0.99));
}
