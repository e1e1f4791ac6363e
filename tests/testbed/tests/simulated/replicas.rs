//! Networks in which nodes have streams of others, beside packages, calls and time. Without being asked for more, a few
//! seconds of each kind; 10^5 networks take a day of two processors.

use super::guard::guard;
use super::seen::{SEEN_IN_A_HUNDRED_REPLICATED, SEEN_IN_A_HUNDRED_REPLICATED_SLOTTED};
use super::{asked, validate};
use rohrpost_testbed::sim::plan::Plan;
use rohrpost_testbed::sim::run::run;

/// Networks of each kind without being asked for more.
const SEEDS: u64 = 12;

#[test]
fn replicas_keep_their_promises() {
    let plan = |seed| Plan::new(seed).replicated();
    validate("replicas_keep_their_promises", asked(SEEDS), plan, &SEEN_IN_A_HUNDRED_REPLICATED);
}

#[test]
fn sealed_replicas_keep_their_promises() {
    let plan = |seed| Plan::new(seed).sealed().replicated();
    validate("sealed_replicas_keep_their_promises", asked(SEEDS), plan, &SEEN_IN_A_HUNDRED_REPLICATED);
}

#[test]
fn replicas_in_time_slots_keep_their_promises() {
    let plan = |seed| Plan::small_slotted(seed).replicated();
    validate("replicas_in_time_slots_keep_their_promises", asked(SEEDS), plan, &SEEN_IN_A_HUNDRED_REPLICATED_SLOTTED);
}

#[test]
fn sealed_replicas_in_time_slots_keep_their_promises() {
    let plan = |seed| Plan::small_slotted(seed).sealed().replicated();
    validate(
        "sealed_replicas_in_time_slots_keep_their_promises",
        asked(SEEDS),
        plan,
        &SEEN_IN_A_HUNDRED_REPLICATED_SLOTTED,
    );
}

#[test]
fn a_seed_gives_the_same_records_again() {
    let plan = || Plan::new(3).replicated();
    let (once, again) = (run(plan(), guard, true), run(plan(), guard, true));
    assert!(once.problems.is_empty(), "{:?}", once.problems);
    assert_eq!(once.seen, again.seen);
}
