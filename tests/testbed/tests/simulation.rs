//! Hundreds of simulated networks: `ROHRPOST_SIM_SEEDS=10000` for more of them, from `ROHRPOST_SIM_FIRST=n` on;
//! `ROHRPOST_SIM_SEED=n` to see one line by line.

#[path = "simulated/guard.rs"]
mod guard;
#[path = "simulated/leases.rs"]
mod leases;
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
use rohrpost_testbed::sim::run::{Outcome, run};
use seen::{
    SEEN_IN_A_HUNDRED, SEEN_IN_A_HUNDRED_EDITED, SEEN_IN_A_HUNDRED_ROUGH_SLOTTED, SEEN_IN_A_HUNDRED_SEALED,
    SEEN_IN_A_HUNDRED_SEALED_SLOTTED, SEEN_IN_A_HUNDRED_SLOTTED, SEEN_IN_A_HUNDRED_UNSTEADY,
};
use simulated::{for_all, number};
use std::collections::BTreeMap;
use std::time::Instant;

/// Networks without being asked for more; of most kinds a part of them.
const SEEDS: u64 = 100;
/// Networks in which all goes wrong.
const ROUGH_SEEDS: u64 = 6;
/// Cycles of a network in which a master might be taken for dead.
const LOSSY_CYCLES: u64 = 1000;

/// How often each thing was seen, in several networks together.
type Seen = BTreeMap<&'static str, u64>;

/// What a broken promise looks like, and how to see it again.
fn told(test: &str, seed: u64, problem: &Problem) -> String {
    let Problem { promise, at_ns, text } = problem;
    let at_ms = at_ns / 1_000_000;
    format!(
        "seed {seed}, at {at_ms} ms, {promise:?}: {text}\nreplay: ROHRPOST_SIM_SEED={seed} cargo test -p \
         rohrpost-testbed --test simulation {test} -- --nocapture"
    )
}

/// Networks that the environment asks for, or `usually`.
fn asked(usually: u64) -> u64 {
    number("ROHRPOST_SIM_SEEDS").unwrap_or(usually)
}

/// Whether the environment asks for one network of this kind, line by line.
fn is_replayed(plan: impl Fn(u64) -> Plan) -> bool {
    let Some(seed) = number("ROHRPOST_SIM_SEED") else { return false };
    let plan = plan(seed);
    eprintln!("{plan:#?}");
    let outcome = run(plan, guard, true);
    outcome.trace.iter().for_each(|line| eprintln!("{line}"));
    eprintln!("{:#?}", outcome.seen);
    assert!(outcome.problems.is_empty(), "{}", told("_", seed, &outcome.problems[0]));
    true
}

/// Runs networks of one kind, which keep all promises; what became of each.
fn keep_promises(test: &str, seeds: &[u64], plan: impl Fn(u64) -> Plan + Sync) -> Vec<Outcome> {
    let (outcomes, broken): (Vec<Outcome>, Vec<Option<String>>) = for_all(seeds.len() as u64, |index| {
        let seed = seeds[index as usize];
        let outcome = run(plan(seed), guard, false);
        let told = outcome.problems.first().map(|problem| told(test, seed, problem));
        // At once: thousands of networks take their time.
        told.iter().for_each(|told| eprintln!("{told}"));
        (outcome, told)
    })
    .into_iter()
    .unzip();
    let broken: Vec<String> = broken.into_iter().flatten().collect();
    assert!(broken.is_empty(), "{} of {} broke a promise:\n{}", broken.len(), seeds.len(), broken.join("\n"));
    outcomes
}

/// So many networks of one kind keep all promises, and enough happens in them: it is worth nothing that all went well
/// where little did. None if one is replayed instead.
fn validate(test: &str, seeds: u64, plan: fn(u64) -> Plan, in_a_hundred: &[(&str, u64)]) -> Option<Seen> {
    if is_replayed(plan) {
        return None;
    }
    let (began, first) = (Instant::now(), number("ROHRPOST_SIM_FIRST").unwrap_or(0));
    let mut seen = Seen::new();
    for outcome in keep_promises(test, &(first..first + seeds).collect::<Vec<_>>(), plan) {
        outcome.seen.iter().for_each(|(what, count)| *seen.entry(what).or_default() += count);
    }
    eprintln!("{seeds} networks in {:.1?}: {seen:#?}", began.elapsed());
    for (what, least) in in_a_hundred {
        let least = least * seeds / 100;
        assert!(
            seen.get(what).copied() >= Some(least),
            "less than {least} of `{what}`, too few to prove much: {seen:#?}"
        );
    }
    Some(seen)
}

#[test]
fn a_hundred_networks_keep_their_promises() {
    validate("a_hundred_networks", asked(SEEDS), Plan::new, &SEEN_IN_A_HUNDRED);
}

/// Each of these has shown a bug that a hundred networks seldom show.
#[test]
fn networks_that_broke_a_promise_once_keep_it() {
    keep_promises("a_hundred_networks", &[2917, 8011, 8247, 8335], Plan::new);
    // A cycle of 70 ms: nodes that read a Sync late, just before their own slot, did not ask.
    keep_promises("networks_with_time_slots", &[122], Plan::slotted);
}

#[test]
fn networks_with_time_slots_keep_their_promises() {
    validate("networks_with_time_slots", asked(SEEDS) / 4, Plan::slotted, &SEEN_IN_A_HUNDRED_SLOTTED);
}

#[test]
fn sealed_networks_with_time_slots_keep_their_promises() {
    let plan = |seed| Plan::slotted(seed).sealed();
    validate("sealed_networks_with_time_slots", asked(SEEDS) / 4, plan, &SEEN_IN_A_HUNDRED_SEALED_SLOTTED);
}

#[test]
fn sealed_networks_keep_their_promises_whatever_is_recorded_altered_and_sent_again() {
    let plan = |seed| Plan::new(seed).sealed();
    validate("sealed_networks", asked(SEEDS) / 4, plan, &SEEN_IN_A_HUNDRED_SEALED);
}

#[test]
fn rough_networks_keep_their_promises() {
    if !is_replayed(Plan::rough) {
        keep_promises("rough", &(0..ROUGH_SEEDS).collect::<Vec<_>>(), Plan::rough);
    }
}

/// Computers that sleep, and clocks that somebody slews.
#[test]
fn networks_of_unsteady_clocks_keep_their_promises() {
    validate("networks_of_unsteady_clocks", asked(SEEDS) / 4, Plan::unsteady, &SEEN_IN_A_HUNDRED_UNSTEADY);
}

/// Have shown bugs, of the core or of what checks it, that thousands of such networks seldom show.
#[test]
fn slotted_networks_of_unsteady_clocks_that_broke_a_promise_once_keep_it() {
    keep_promises("slotted_networks_of_unsteady", &[3804, 4630, 4666], Plan::unsteady_slotted);
}

/// The same with time slots.
#[test]
fn slotted_networks_of_unsteady_clocks_keep_their_promises() {
    let test = "slotted_networks_of_unsteady_clocks";
    validate(test, asked(SEEDS) / 4, Plan::unsteady_slotted, &SEEN_IN_A_HUNDRED_UNSTEADY);
}

/// Routers that are started from edited files, each field in turn: nodes of several tables on one wire; sealed ones by
/// turns.
#[test]
fn networks_with_edited_files_keep_their_promises() {
    validate("networks_with_edited_files", asked(SEEDS) / 2, edited, &SEEN_IN_A_HUNDRED_EDITED);
}

fn edited(seed: u64) -> Plan {
    if seed % 3 == 2 { Plan::edited(seed).sealed() } else { Plan::edited(seed) }
}

/// Each of these has shown a bug that thousands of such networks seldom show.
#[test]
fn networks_with_edited_files_that_broke_a_promise_once_keep_it() {
    keep_promises("networks_with_edited_files", &[3404, 4202, 4619, 5318, 5546], edited);
}

/// Each of these has shown a bug that hundreds of networks with time slots seldom show.
#[test]
fn networks_with_time_slots_that_broke_a_promise_once_keep_it() {
    let broke = [
        13, 60, 273, 288, 290, 316, 336, 339, 356, 438, 543, 736, 846, 933, 1385, 1464, 1499, 1792, 1849, 2181, 2207,
        10_019, 10_984, 11_190,
    ];
    keep_promises("networks_with_time_slots", &broke, Plan::slotted);
}

#[test]
fn rough_slotted_networks_keep_their_promises() {
    let seen = &SEEN_IN_A_HUNDRED_ROUGH_SLOTTED;
    validate("rough_slotted_networks", asked(SEEDS) / 10, Plan::rough_slotted, seen);
}

/// A network keeps a master that does not die: at most one change in 100 000 cycles, where up to one datagram of 20
/// is lost.
#[test]
fn losses_and_late_wake_ups_change_no_master() {
    let plan = |seed| Plan::lossy_slotted(seed, LOSSY_CYCLES);
    if is_replayed(plan) {
        return;
    }
    let seeds = asked(SEEDS) / 4;
    let outcomes = keep_promises("losses", &(0..seeds).collect::<Vec<_>>(), plan);
    let mut changes = 0;
    for (seed, outcome) in (0..).zip(outcomes) {
        if let Some(its) = outcome.seen.get("took over") {
            let loss_ppm = plan(seed).quality.loss_ppm;
            eprintln!("seed {seed}: {its} changes, where {loss_ppm} of a million datagrams are lost");
            changes += its;
        }
    }
    let cycles = seeds * LOSSY_CYCLES;
    eprintln!("{changes} changes of master in {cycles} cycles");
    assert!(changes <= cycles.div_ceil(100_000), "{changes} changes of master in {cycles} cycles");
}

#[test]
fn in_a_calm_network_nothing_is_lost() {
    for (seed, outcome) in keep_promises("calm", &(0..10).collect::<Vec<_>>(), Plan::calm).into_iter().enumerate() {
        for lost in ["quota", "stale", "silent", "late", "incomplete", "mailbox-full", "lost on the wire"] {
            assert_eq!(outcome.seen.get(lost), None, "seed {seed}: {lost}");
        }
    }
}

#[test]
fn where_nothing_is_reordered_nothing_is_late_however_many_flows_there_are() {
    let enough = &[("delivered", 100_000)];
    let seen = validate("where_nothing_is_reordered", asked(SEEDS) / 10, Plan::crowded, enough);
    assert_eq!(seen.and_then(|seen| seen.get("late").copied()), None);
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
    let seeds = asked(SEEDS) / 4;
    let Some(seen) = validate(test, seeds, plan, &[("delivered", 10_000), (fault, 1_000)]) else { return };
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
}

#[test]
fn a_seed_gives_the_same_network_again() {
    let once = run(Plan::new(3), guard, true);
    let again = run(Plan::new(3), guard, true);
    assert_eq!(once.seen, again.seen);
    assert_eq!(once.trace, again.trace);
}
