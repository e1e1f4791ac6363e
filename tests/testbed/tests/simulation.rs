//! Hundreds of simulated networks: `ROHRPOST_SIM_SEEDS=10000` for more of them, from `ROHRPOST_SIM_FIRST=n` on;
//! `ROHRPOST_SIM_SEED=n` to see one line by line.

#[path = "simulated/guard.rs"]
mod guard;
#[path = "simulated/rare.rs"]
mod rare;
#[path = "simulated/replicas.rs"]
mod replicas;
#[path = "simulated/seen.rs"]
mod seen;
mod simulated;

use guard::guard;
use rohrpost_testbed::sim;
use rohrpost_testbed::sim::plan::Plan;
use rohrpost_testbed::sim::promise::Problem;
use rohrpost_testbed::sim::run::run;
use seen::{
    SEEN_IN_A_HUNDRED, SEEN_IN_A_HUNDRED_EDITED, SEEN_IN_A_HUNDRED_ROUGH_SLOTTED, SEEN_IN_A_HUNDRED_SEALED,
    SEEN_IN_A_HUNDRED_SEALED_SLOTTED, SEEN_IN_A_HUNDRED_SLOTTED, SEEN_IN_A_HUNDRED_UNSTEADY,
};
use simulated::{for_all, number};
use std::collections::BTreeMap;
use std::time::Instant;

/// Networks without being asked for more.
const SEEDS: u64 = 100;
/// Networks in which all goes wrong.
const ROUGH_SEEDS: u64 = 6;
/// Cycles of a network in which a master might be taken for dead.
const LOSSY_CYCLES: u64 = 1000;
/// The test of all promises.
const NETWORKS: &str = "a_hundred_networks";
/// The same with sealed datagrams: a quarter as many.
const SEALED: &str = "sealed_networks";
/// The same with time slots: a quarter as many.
const SLOTTED: &str = "networks_with_time_slots";
/// The same with time slots and sealed datagrams: a quarter as many.
const SEALED_SLOTTED: &str = "sealed_networks_with_time_slots";
/// Those in which all goes wrong: a tenth as many.
const ROUGH_SLOTTED: &str = "rough_slotted_networks";
/// What a broken promise looks like, and how to see it again.
fn told(test: &str, seed: u64, problem: &Problem) -> String {
    let Problem { promise, at_ns, text } = problem;
    let at_ms = at_ns / 1_000_000;
    format!(
        "seed {seed}, at {at_ms} ms, {promise:?}: {text}\nreplay: ROHRPOST_SIM_SEED={seed} cargo test -p \
         rohrpost-testbed --test simulation {test} -- --nocapture"
    )
}

fn replay(plan: Plan) {
    let seed = plan.seed;
    eprintln!("{plan:#?}");
    let outcome = run(plan, guard, true);
    outcome.trace.iter().for_each(|line| eprintln!("{line}"));
    eprintln!("{:#?}", outcome.seen);
    assert!(outcome.problems.is_empty(), "{}", told("_", seed, &outcome.problems[0]));
}

/// Runs all of them; what was seen in all together.
fn keep_promises(test: &str, seeds: u64, plan: fn(u64) -> Plan) -> BTreeMap<&'static str, u64> {
    let began = Instant::now();
    let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
    let mut broken = Vec::new();
    let first = number("ROHRPOST_SIM_FIRST").unwrap_or(0);
    let validated = |seed| {
        let outcome = run(plan(seed), guard, false);
        let told = outcome.problems.first().map(|problem| told(test, seed, problem));
        // At once: thousands of networks take their time.
        told.iter().for_each(|told| eprintln!("{told}"));
        (told, outcome)
    };
    for (told, outcome) in for_all(seeds, |seed| validated(first + seed)) {
        broken.extend(told);
        outcome.seen.iter().for_each(|(what, count)| *seen.entry(what).or_default() += count);
    }
    assert!(broken.is_empty(), "{} of {seeds} networks broke a promise:\n{}", broken.len(), broken.join("\n"));
    eprintln!("{seeds} networks in {:.1?}: {seen:#?}", began.elapsed());
    seen
}

/// It is worth nothing that all went well where little happened.
fn saw_enough(seen: &BTreeMap<&str, u64>, seeds: u64, in_a_hundred: &[(&str, u64)]) {
    for (what, least) in in_a_hundred {
        let least = least * seeds / 100;
        assert!(
            seen.get(what).copied() >= Some(least),
            "less than {least} of `{what}`, too few to prove much: {seen:#?}"
        );
    }
}

#[test]
fn a_hundred_networks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::new(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS);
    let seen = keep_promises(NETWORKS, seeds, Plan::new);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED);
}

/// Each of these has shown a bug that a hundred networks seldom show.
#[test]
fn networks_that_broke_a_promise_once_keep_it() {
    for seed in [2917, 8011, 8247, 8335] {
        let outcome = run(Plan::new(seed), guard, false);
        assert!(outcome.problems.is_empty(), "{}", told(NETWORKS, seed, &outcome.problems[0]));
    }
    // A cycle of 70 ms: nodes that read a Sync late, just before their own slot, did not ask.
    let slotted = 122;
    let outcome = run(Plan::slotted(slotted), guard, false);
    assert!(outcome.problems.is_empty(), "{}", told(SLOTTED, slotted, &outcome.problems[0]));
}

#[test]
fn networks_with_time_slots_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::slotted(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises(SLOTTED, seeds, Plan::slotted);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_SLOTTED);
}

#[test]
fn sealed_networks_with_time_slots_keep_their_promises() {
    let plan = |seed| Plan::slotted(seed).sealed();
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(plan(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises(SEALED_SLOTTED, seeds, plan);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_SEALED_SLOTTED);
}

#[test]
fn sealed_networks_keep_their_promises_whatever_is_recorded_altered_and_sent_again() {
    let plan = |seed| Plan::new(seed).sealed();
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(plan(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises(SEALED, seeds, plan);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_SEALED);
}

#[test]
fn rough_networks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::rough(seed));
    }
    for (seed, outcome) in for_all(ROUGH_SEEDS, |seed| (seed, run(Plan::rough(seed), guard, false))) {
        assert!(outcome.problems.is_empty(), "{}", told("rough", seed, &outcome.problems[0]));
    }
}

/// Computers that sleep, and clocks that somebody slews. A quarter as many networks.
#[test]
fn networks_of_unsteady_clocks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::unsteady(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises("networks_of_unsteady_clocks", seeds, Plan::unsteady);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_UNSTEADY);
}

/// Have shown bugs, of the core or of what checks it, that thousands of such networks seldom show.
#[test]
fn slotted_networks_of_unsteady_clocks_that_broke_a_promise_once_keep_it() {
    for seed in [3804, 4630, 4666] {
        let outcome = run(Plan::unsteady_slotted(seed), guard, false);
        assert!(outcome.problems.is_empty(), "{}", told("slotted_networks_of_unsteady", seed, &outcome.problems[0]));
    }
}

/// The same with time slots.
#[test]
fn slotted_networks_of_unsteady_clocks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::unsteady_slotted(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises("slotted_networks_of_unsteady_clocks", seeds, Plan::unsteady_slotted);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_UNSTEADY);
}

/// Routers that are started from edited files, each field in turn: nodes of several tables on one wire. Half as many
/// networks; sealed ones by turns.
#[test]
fn networks_with_edited_files_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(edited(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 2;
    let seen = keep_promises("networks_with_edited_files", seeds, edited);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_EDITED);
}

fn edited(seed: u64) -> Plan {
    if seed % 3 == 2 { Plan::edited(seed).sealed() } else { Plan::edited(seed) }
}

/// Each of these has shown a bug that thousands of such networks seldom show.
#[test]
fn networks_with_edited_files_that_broke_a_promise_once_keep_it() {
    for seed in [3404, 4202, 4619, 5318, 5546] {
        let outcome = run(edited(seed), guard, false);
        assert!(outcome.problems.is_empty(), "{}", told("networks_with_edited_files", seed, &outcome.problems[0]));
    }
}

/// Each of these has shown a bug that hundreds of networks with time slots seldom show.
#[test]
fn networks_with_time_slots_that_broke_a_promise_once_keep_it() {
    let broke = [
        13, 60, 273, 288, 290, 316, 336, 339, 356, 438, 543, 736, 846, 933, 1385, 1464, 1499, 1792, 1849, 2181, 2207,
        10_019, 10_984, 11_190,
    ];
    for (seed, outcome) in for_all(broke.len() as u64, |index| {
        let seed = broke[index as usize];
        (seed, run(Plan::slotted(seed), guard, false))
    }) {
        assert!(outcome.problems.is_empty(), "{}", told(SLOTTED, seed, &outcome.problems[0]));
    }
}

#[test]
fn rough_slotted_networks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::rough_slotted(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 10;
    let seen = keep_promises(ROUGH_SLOTTED, seeds, Plan::rough_slotted);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED_ROUGH_SLOTTED);
}

/// A network keeps a master that does not die: at most one change in 100 000 cycles, where up to one datagram of 20
/// is lost. A quarter as many networks.
#[test]
fn losses_and_late_wake_ups_change_no_master() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::lossy_slotted(seed, LOSSY_CYCLES));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let changes = for_all(seeds, |seed| {
        let plan = Plan::lossy_slotted(seed, LOSSY_CYCLES);
        let loss_ppm = plan.quality.loss_ppm;
        let outcome = run(plan, guard, false);
        assert!(outcome.problems.is_empty(), "{}", told("losses", seed, &outcome.problems[0]));
        let changes = outcome.seen.get("took over").copied().unwrap_or_default();
        if changes > 0 {
            eprintln!("seed {seed}: {changes} changes, where {loss_ppm} of a million datagrams are lost");
        }
        changes
    });
    let (changes, cycles) = (changes.iter().sum::<u64>(), seeds * LOSSY_CYCLES);
    eprintln!("{changes} changes of master in {cycles} cycles");
    assert!(changes <= cycles.div_ceil(100_000), "{changes} changes of master in {cycles} cycles");
}

#[test]
fn in_a_calm_network_nothing_is_lost() {
    for (seed, outcome) in for_all(10, |seed| (seed, run(Plan::calm(seed), guard, false))) {
        assert!(outcome.problems.is_empty(), "{}", told("calm", seed, &outcome.problems[0]));
        for lost in ["quota", "stale", "silent", "late", "incomplete", "mailbox-full", "lost on the wire"] {
            assert_eq!(outcome.seen.get(lost), None, "seed {seed}: {lost}");
        }
    }
}

#[test]
fn where_nothing_is_reordered_nothing_is_late_however_many_flows_there_are() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::crowded(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 10;
    let seen = keep_promises("where_nothing_is_reordered", seeds, Plan::crowded);
    assert_eq!(seen.get("late"), None);
    saw_enough(&seen, seeds, &[("delivered", 100_000)]);
}

#[test]
fn what_a_router_could_have_sent_parts_no_nodes_and_loses_nothing() {
    parts_no_nodes("what_a_router_could_have_sent", Plan::forged, "forged");
}

#[test]
fn what_is_for_another_port_parts_no_nodes_and_loses_nothing() {
    parts_no_nodes("what_is_for_another_port", Plan::strayed, "strayed");
}

/// Networks in which nothing goes wrong but what is seen by this name.
fn parts_no_nodes(test: &str, plan: fn(u64) -> Plan, fault: &str) {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(plan(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises(test, seeds, plan);
    for lost in ["stale", "silent", "refused", "late", "lost on the wire"] {
        assert_eq!(seen.get(lost), None, "{lost}");
    }
    // To their quotas, and in parts before a receiver had begun, some of these networks lose packages anyway: no more
    // than without.
    let calm = for_all(seeds, |seed| run(Plan::calm(seed), guard, false).seen);
    for lost in ["quota", "incomplete"] {
        let anyway = calm.iter().filter_map(|seen| seen.get(lost)).sum::<u64>();
        assert_eq!(seen.get(lost).copied().unwrap_or_default(), anyway, "{lost}");
    }
    saw_enough(&seen, seeds, &[("delivered", 10_000), (fault, 1_000)]);
}

#[test]
fn a_seed_gives_the_same_network_again() {
    let once = run(Plan::new(3), guard, true);
    let again = run(Plan::new(3), guard, true);
    assert_eq!(once.seen, again.seen);
    assert_eq!(once.trace, again.trace);
}
