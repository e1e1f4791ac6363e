//! Sealed networks in which it is hard to join: slots that come each half second, and six nodes of which one may be
//! master.

use super::simulated::number;
use super::{asked, is_replayed, keep_promises, validate};
use rohrpost_testbed::sim::plan::Plan;

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
    validate("sealed_networks_of_rare", asked(SEEDS) / 4, Plan::rare, &SEEN_IN_A_HUNDRED);
}

/// 21 has shown masters that took over from each other all the time, since a node that asks in rare slots is answered
/// seldom; so has 3.
#[test]
fn a_node_that_begins_in_a_sealed_network_of_rare_slots_joins_in_time() {
    if is_replayed(Plan::rare_joining) {
        return;
    }
    let first = number("ROHRPOST_SIM_FIRST").unwrap_or(0);
    let seeds: Vec<u64> = (first..first + asked(SEEDS) / 4).chain([21]).collect();
    let outcomes = keep_promises("a_node_that_begins_in_a_sealed", &seeds, Plan::rare_joining);
    for (seed, outcome) in seeds.into_iter().zip(outcomes) {
        let joined = outcome.seen.get("joined").copied().unwrap_or(0);
        assert!(joined >= 2 * Plan::rare_joining(seed).nodes.len() as u64, "seed {seed}: {joined} have joined");
    }
}
