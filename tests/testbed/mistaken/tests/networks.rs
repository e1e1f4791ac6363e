//! The simulation notices the mistakes that are planted in the routers: each breaks a promise in some network.

extern crate rohrpost_mistaken as rohrpost_routers;

#[path = "../../tests/simulated/guard.rs"]
mod guard;
#[allow(dead_code, unreachable_pub, reason = "the testbed's own tests use all of it")]
#[path = "../../src/sim/mod.rs"]
mod sim;
#[allow(dead_code, reason = "the testbed's own tests use all of it")]
#[path = "../../tests/simulated/mod.rs"]
mod simulated;

use guard::guard;
use rohrpost_mistaken::mistakes::{Mistake, with};
use sim::plan::Plan;
use sim::promise::Promise;
use sim::run::{Outcome, run};
use simulated::for_all;

/// Networks in which a mistake must show.
const SEEDS: u64 = 20;
/// The same where the analysis of slots declares the flows.
const DECLARED_SEEDS: u64 = 60;
/// Networks in which a promise must be the first that is broken: most mistakes break another before it.
const PROMISE_SEEDS: u64 = 300;
/// Mistakes that cannot show here, because something else prevents each; the routers' own tests show them. Heads in
/// this simulation are never the same twice. Duplicates of a fragment are dropped as datagrams. An urgent package that
/// waits for the pace breaks no promise but that of speed.
const UNSEEN: [Mistake; 3] = [Mistake::MixesPackages, Mistake::CountsPartsTwice, Mistake::NeverInAdvance];
/// Mistakes that show in few networks; the routers' own tests show them. A node with another digest has an incarnation
/// that is doubted anyway.
const SELDOM: [Mistake; 5] = [
    Mistake::TakesOtherDigests,
    Mistake::KeepsOwnTime,
    Mistake::NeverUnheard,
    Mistake::ForgetsFloor,
    Mistake::OldSamples,
];

fn run_with(mistake: Mistake, plan: Plan) -> Outcome {
    with(mistake, || run(plan, guard, false))
}

/// The promise that a network breaks first with a mistake. Without it the network keeps all of them.
fn first_broken(mistake: Mistake, plan: Plan) -> Option<Promise> {
    let first = run_with(mistake, plan.clone()).problems.into_iter().next()?;
    let healthy = run(plan, guard, false);
    assert!(healthy.problems.is_empty(), "without {mistake:?}: {:?}", healthy.problems[0]);
    Some(first.promise)
}

/// The first seed with a network that shows a mistake.
fn noticed(mistake: Mistake, plan: fn(u64) -> Plan, seeds: u64) -> Option<(u64, Promise)> {
    (0..seeds).find_map(|seed| first_broken(mistake, plan(seed)).map(|promise| (seed, promise)))
}

/// Each of them breaks a promise in some network.
fn all_are_noticed(mistakes: &[Mistake], plan: fn(u64) -> Plan) {
    let found = for_all(mistakes.len() as u64, |index| {
        let mistake = mistakes[index as usize];
        (mistake, noticed(mistake, plan, SEEDS))
    });
    found.iter().for_each(|(mistake, seed)| eprintln!("{mistake:?}: {seed:?}"));
    let missed: Vec<_> = found.iter().filter(|(_, seed)| seed.is_none()).collect();
    assert!(missed.is_empty(), "went unnoticed in {SEEDS} networks: {missed:?}");
}

/// What breaks first in some network is this promise.
fn each_breaks_its_promise(broken: &[(Mistake, Promise)], plan: fn(u64) -> Plan) {
    let found = for_all(broken.len() as u64, |index| {
        let (mistake, promise) = broken[index as usize];
        let breaks = |seed: &u64| first_broken(mistake, plan(*seed)) == Some(promise);
        (mistake, promise, (0..PROMISE_SEEDS).find(breaks))
    });
    eprintln!("{found:?}");
    let missed: Vec<_> = found.iter().filter(|(_, _, found)| found.is_none()).collect();
    assert!(missed.is_empty(), "in {PROMISE_SEEDS} networks not seen as what they are: {missed:?}");
}

fn without(mistakes: &[Mistake], left_out: &[Mistake]) -> Vec<Mistake> {
    mistakes.iter().copied().filter(|mistake| !left_out.contains(mistake)).collect()
}

#[test]
fn every_mistake_of_a_core_is_noticed() {
    let mistakes = [&Mistake::CARRYING[..], &Mistake::TIME].concat();
    all_are_noticed(&without(&mistakes, &[&UNSEEN[..], &SELDOM].concat()), Plan::rough);
}

#[test]
fn every_mistake_with_many_flows_is_noticed() {
    all_are_noticed(&Mistake::CROWDED, Plan::crowded);
}

#[test]
fn every_mistake_with_forged_datagrams_is_noticed() {
    all_are_noticed(&Mistake::FORGED, Plan::forged);
}

#[test]
fn every_mistake_of_unsteady_clocks_is_noticed() {
    let plans: [fn(u64) -> Plan; 2] = [Plan::unsteady, Plan::unsteady_slotted];
    plans.into_iter().for_each(|plan| all_are_noticed(&Mistake::UNSTEADY, plan));
}

#[test]
fn every_mistake_beside_other_tables_is_noticed() {
    all_are_noticed(&Mistake::TABLES, Plan::edited);
}

/// In networks with a program that writes what it likes in its heads, and a router that lets it, each mistake of
/// admission breaks the promise of admission first.
#[test]
fn every_mistake_of_admission_is_noticed_by_what_an_intruder_gets() {
    let broken = Mistake::ADMISSION.map(|mistake| (mistake, Promise::Admission));
    each_breaks_its_promise(&broken, |seed| Plan::new(4 * seed + 2).sealed());
}

#[test]
fn every_mistake_in_time_slots_is_noticed() {
    let mistakes = [&Mistake::SLOTS[..], &Mistake::IN_SLOT].concat();
    all_are_noticed(&without(&mistakes, &SELDOM), Plan::slotted);
}

/// A router that fills datagrams without regard to its mailbox adds packages that are less important than one there.
#[test]
fn a_router_that_forgets_its_mailbox_is_noticed_where_flows_are_declared() {
    let found = noticed(Mistake::ForgetsMailbox, Plan::declared, DECLARED_SEEDS);
    assert!(found.is_some(), "went unnoticed in {DECLARED_SEEDS} networks");
}

#[test]
fn every_promise_of_time_slots_can_be_broken() {
    let broken = [
        (Mistake::BeginsAtOnce, Promise::Exclusive),
        (Mistake::Stubborn, Promise::Exclusive),
        (Mistake::TrustsItself, Promise::SilentWhenUnsure),
        (Mistake::AsksTooSoon, Promise::InWindow),
        (Mistake::BeginsForEver, Promise::Recovery),
        (Mistake::NeverBeginsEpoch, Promise::Recovery),
    ];
    each_breaks_its_promise(&broken, Plan::slotted);
}

/// `TakesUnproven` and `WaitsForEver` show in the routers' own tests.
#[test]
fn every_promise_of_sealed_time_slots_can_be_broken() {
    let broken = [
        (Mistake::IgnoresUnproven, Promise::Exclusive),
        (Mistake::TellsUnproven, Promise::SilentWhenUnsure),
        (Mistake::AsksWithoutPause, Promise::SilentWhenUnsure),
    ];
    each_breaks_its_promise(&broken, |seed| Plan::slotted(seed).sealed());
}
