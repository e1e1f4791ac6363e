//! The simulation notices the mistakes that are planted in the routers: each breaks the promise that [`CAUGHT`] names
//! for it. Without the mistake the same network keeps all promises.

extern crate rohrpost_mistaken as rohrpost_routers;

#[path = "networks/caught.rs"]
mod caught;
#[path = "../../tests/simulated/guard.rs"]
mod guard;
#[allow(dead_code, unreachable_pub, reason = "the testbed's own tests use all of it")]
#[path = "../../src/sim/mod.rs"]
mod sim;
#[allow(dead_code, reason = "the testbed's own tests use all of it")]
#[path = "../../tests/simulated/mod.rs"]
mod simulated;

use caught::{CAUGHT, Caught, Network, UNSEEN, UNSEEN_GROUPS};
use guard::guard;
use rohrpost_mistaken::catalog::{self, GROUPS};
use rohrpost_mistaken::mistakes::{Mistake, with};
use sim::promise::Promise;
use sim::run::run;
use simulated::for_all;
use std::collections::BTreeSet;

/// Where the seed of the table does not catch a mistake any more, so many others are tried.
const SEARCHED_SEEDS: u64 = 300;

/// What a network breaks with a mistake. Its run ends with the first event that breaks anything.
fn broken(mistake: Mistake, network: Network, seed: u64) -> BTreeSet<Promise> {
    let outcome = with(mistake, || run(network.plan(seed), guard, false));
    outcome.problems.into_iter().map(|problem| problem.promise).collect()
}

/// What is wrong with an entry of the table, and which seed is a better one.
fn unnoticed(caught: &Caught, searched: u64) -> Option<String> {
    let Caught { mistake, promise, network, seed } = *caught;
    let instead = broken(mistake, network, seed);
    if instead.contains(&promise) {
        return None;
    }
    let next = (0..searched).find(|seed| broken(mistake, network, *seed).contains(&promise));
    let next = next.map_or(format!("none below {searched}"), |seed| seed.to_string());
    Some(format!(
        "{mistake:?}: {network:?} {seed} breaks {instead:?}, not {promise:?}; the next seed that does: {next}"
    ))
}

#[test]
fn each_mistake_breaks_the_promise_that_is_named_for_it() {
    let missed = for_all(CAUGHT.len() as u64, |index| unnoticed(&CAUGHT[index as usize], SEARCHED_SEEDS));
    let missed: Vec<_> = missed.into_iter().flatten().collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn without_a_mistake_the_same_networks_keep_all_promises() {
    let networks: BTreeSet<_> = CAUGHT.iter().map(|caught| (caught.network, caught.seed)).collect();
    let networks: Vec<_> = networks.into_iter().collect();
    let broken = for_all(networks.len() as u64, |index| {
        let (network, seed) = networks[index as usize];
        let problem = run(network.plan(seed), guard, false).problems.into_iter().next();
        problem.map(|problem| format!("{network:?} {seed}: {problem:?}"))
    });
    let broken: Vec<_> = broken.into_iter().flatten().collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_promise_is_broken_by_a_mistake() {
    let broken: BTreeSet<_> = CAUGHT.iter().map(|caught| caught.promise).collect();
    assert_eq!(broken, BTreeSet::from(Promise::ALL));
}

#[test]
fn every_mistake_names_a_promise_or_is_said_to_break_none() {
    let caught: BTreeSet<_> = CAUGHT.iter().map(|caught| format!("{:?}", caught.mistake)).collect();
    let unseen = UNSEEN.iter().map(|(mistake, _)| format!("{mistake:?}"));
    let groups = GROUPS.iter().filter(|group| UNSEEN_GROUPS.contains(&group.name));
    let unseen: BTreeSet<_> =
        unseen.chain(groups.flat_map(|group| group.mistakes).map(|planted| planted.name.into())).collect();
    assert_eq!(caught.intersection(&unseen).collect::<Vec<_>>(), Vec::<&String>::new(), "named and unseen");
    let all: BTreeSet<String> = catalog::all().map(|planted| planted.name.into()).collect();
    assert_eq!(caught.union(&unseen).cloned().collect::<BTreeSet<_>>(), all);
}

#[test]
fn two_masters_of_one_term_are_told() {
    let caught = CAUGHT.iter().find(|caught| caught.mistake == Mistake::SharesTerms).expect("it is there");
    let problems = with(caught.mistake, || run(caught.network.plan(caught.seed), guard, false)).problems;
    assert!(problems.iter().any(|problem| problem.text.contains("are masters of Term")), "{problems:?}");
}

#[test]
fn a_mistake_that_a_network_does_not_show_is_told_with_the_next_seed() {
    let caught = CAUGHT.iter().find(|caught| caught.mistake == Mistake::IgnoresLevels).expect("it is there");
    let told = unnoticed(&Caught { promise: Promise::Displacing, ..*caught }, 1).expect("another promise is broken");
    assert!(told.ends_with("breaks {Urgency}, not Displacing; the next seed that does: none below 1"), "{told}");
    let told = unnoticed(&Caught { network: Network::Forged, ..*caught }, 0).expect("nothing is broken there");
    assert!(told.contains("breaks {}, not Urgency"), "{told}");
}
