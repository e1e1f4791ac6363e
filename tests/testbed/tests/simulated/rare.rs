//! Sealed networks in which it is hard to join: slots that come each half second, and six nodes of which one may be
//! master.

use super::{guard, keep_promises, replay, saw_enough, told};
use crate::simulated::{for_all, number};
use rohrpost_testbed::sim::plan::Plan;
use rohrpost_testbed::sim::run::run;

/// Of which a quarter is run, as of other networks with time slots.
const SEEDS: u64 = 48;
/// What must have been seen so often in each hundred networks.
const SEEN_IN_A_HUNDRED: [(&str, u64); 6] = [
    ("delivered", 100_000),
    ("time: overheard", 20_000),
    ("asked by what was overheard", 300),
    ("rejected", 2_000),
    ("router killed", 20),
    ("split", 8),
];

#[test]
fn sealed_networks_of_rare_slots_and_of_one_master_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::rare(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let seen = keep_promises("sealed_networks_of_rare", seeds, Plan::rare);
    saw_enough(&seen, seeds, &SEEN_IN_A_HUNDRED);
}

/// 21 has shown masters that took over from each other all the time, since a node that asks in rare slots is answered
/// seldom; so has 3.
#[test]
fn a_node_that_begins_in_a_sealed_network_of_rare_slots_joins_in_time() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        return replay(Plan::rare_joining(seed));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS) / 4;
    let first = number("ROHRPOST_SIM_FIRST").unwrap_or(0);
    let seed = |index| if index == seeds { 21 } else { first + index };
    for (seed, outcome) in for_all(seeds + 1, |index| (seed(index), run(Plan::rare_joining(seed(index)), guard, false)))
    {
        assert!(outcome.problems.is_empty(), "{}", told("a_node_that_begins_in_a_sealed", seed, &outcome.problems[0]));
        let joined = outcome.seen.get("joined").copied().unwrap_or(0);
        assert!(joined >= 2 * Plan::rare_joining(seed).nodes.len() as u64, "seed {seed}: {joined} have joined");
    }
}
