//! Sessions in simulated networks: `ROHRPOST_SIM_SEEDS=1000` for more of them.

mod admitted;
mod ends;
mod ground;
mod moving;
mod newest;
mod oracle;
mod pipe;
mod plan;
mod registering;
mod replicas;
mod shares;
mod strain;
mod world;

use crate::session::Cause;
use crate::session::client::BACKOFF_MAX_NS;
use plan::{Plan, module};
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Priority, Type};
use std::collections::BTreeMap;
use world::{MS, S, World};

/// After the last fault all clients are registered again within so long: silence is noticed, a handshake given up, and
/// the longest wait is over.
const WELL_NS: u64 = 10 * S;
const SEEDS: u64 = 30;
/// What must have been seen in each ten networks.
const SEEN_IN_TEN: [(&str, u64); 20] = [
    ("routers-own", 50),
    ("delivered", 5000),
    ("to all", 300),
    ("answered", 300),
    ("no-route", 100),
    ("full", 10),
    ("stale", 3),
    ("gone", 1),
    ("offline", 10),
    ("no-mailbox", 10),
    ("up", 100),
    ("down", 50),
    ("silent", 3),
    ("objected", 1),
    ("server restarted", 5),
    ("client restarted", 5),
    ("line faults", 50),
    ("posted", 20_000),
    ("replaced", 20),
    ("impostors", 20),
];

/// One seed: all goes wrong for a while, then all must be well.
fn run(plan: Plan) -> World {
    let seed = plan.seed;
    let mut world = World::new(plan);
    world.run(15 * S);
    (world.may_fail, world.may_post) = (false, false);
    world.run(WELL_NS);
    if world.oracle.problems.is_empty() {
        for index in 0..world.nodes.len() {
            if !world.nodes[index].client.is_up() {
                world.oracle.broken(format!("client {index} is not up again"));
            }
        }
        all_are_reached(&mut world);
        world.check_server(true);
        world.check_clients();
        let replaced = world.replaced();
        world.oracle.seen.insert("replaced", replaced);
    }
    world.oracle.problems.iter_mut().for_each(|problem| *problem = format!("seed {seed}, {problem}"));
    world
}

/// Each sends something to each other, and all of it comes, but what a mailbox does not take.
fn all_are_reached(world: &mut World) {
    let before = world.oracle.packages.len();
    let clients = world.nodes.len();
    for (from, to) in (0..clients).flat_map(|from| (0..clients).map(move |to| (from, to))).filter(|(a, b)| a != b) {
        let (priority, kind) = (Priority(60), Type::command(16));
        let head =
            Head { to: module(to), from: module(from).with_local(1), len: 40, kind, priority, ..Head::default() };
        world.send(from, head, false);
    }
    world.run(3 * S);
    let lost =
        world.oracle.packages[before..].iter().filter(|package| package.delivered.is_empty() && !package.said_lost);
    let lost: Vec<String> = lost.map(|package| format!("{:?} never came", package.head)).collect();
    lost.into_iter().for_each(|text| world.oracle.broken(text));
}

fn seeds() -> u64 {
    std::env::var("ROHRPOST_SIM_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(SEEDS)
}

/// Runs a network of each seed, in which nothing is wrong; what must be seen in each ten of them is seen.
fn all_seeds(run: fn(Plan) -> World, plan: fn(u64) -> Plan, seen_in_ten: &[(&str, u64)]) {
    let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
    for seed in 0..seeds() {
        let world = run(plan(seed));
        assert_eq!(world.oracle.problems, [""; 0]);
        world.oracle.seen.iter().for_each(|(what, count)| *seen.entry(what).or_default() += count);
    }
    eprintln!("{} networks: {seen:#?}", seeds());
    for (what, least) in seen_in_ten {
        assert!(seen.get(what).copied() >= Some(least * seeds() / 10), "too few of `{what}` to prove much: {seen:#?}");
    }
}

#[test]
fn sessions_keep_their_promises_whatever_goes_wrong() {
    all_seeds(run, Plan::rough, &SEEN_IN_TEN);
}

#[test]
fn a_client_that_stands_still_changes_nothing_for_the_others() {
    for seed in 0..4 {
        let stalled = 1;
        // How old packages among the others are when they come, ns.
        let ages = |is_stalled: bool| {
            let mut world = World::new(Plan { stalled: is_stalled.then_some(stalled), ..Plan::calm(seed) });
            world.run(8 * S);
            assert_eq!(world.oracle.problems, [""; 0]);
            let others = world.oracle.log.iter().filter(|(_, from, to)| *from != stalled && *to != stalled);
            let mut ages: Vec<u64> = others.map(|(age_ns, _, _)| *age_ns).collect();
            ages.sort_unstable();
            ages
        };
        let (alone, beside) = (ages(false), ages(true));
        let last = |ages: &[u64]| ages[ages.len() * 99 / 100];
        assert!(alone.len() > 500 && beside.len() * 100 > alone.len() * 93, "{} and {}", alone.len(), beside.len());
        assert!(last(&beside) * 10 < last(&alone) * 12, "seed {seed}: {} and {} ns", last(&alone), last(&beside));
    }
}

#[test]
fn a_flood_of_one_client_costs_the_commands_of_others_nothing() {
    for seed in 0..4 {
        let mut world = World::new(Plan::flooded(seed));
        world.run(8 * S);
        world.may_post = false;
        world.run(3 * S);
        assert_eq!(world.oracle.problems, [""; 0], "seed {seed}");
        let flooder = world.plan.flooder.unwrap();
        let lost = world.server.counts().lost_for(Cause::Full) + world.server.counts().lost_for(Cause::Share);
        assert!(lost > 1000, "seed {seed}: {lost} lost of what was too much");
        // What goes to all systems nobody says to be lost.
        let is_one = |package: &&oracle::Posted| package.head.to.system() != ALL_SYSTEMS;
        let mut others = world.oracle.packages.iter().filter(|package| package.from != flooder).filter(is_one);
        assert!(others.clone().count() > 100);
        assert!(others.all(|package| !package.delivered.is_empty() || package.said_lost), "seed {seed}");
    }
}

#[test]
fn a_client_without_a_server_tries_ever_less_often() {
    let mut world = World::new(Plan { clients: 3, ..Plan::calm(1) });
    world.end_server();
    world.run(20 * S);
    for node in &world.nodes {
        let least = 20 * S / BACKOFF_MAX_NS;
        assert!((least..4 * least).contains(&node.attempts), "{} attempts", node.attempts);
    }
}

#[test]
fn a_slow_line_stays_up_however_large_the_packages_are() {
    for seed in 0..3 {
        let mut world = World::new(Plan::slow(seed));
        world.run(60 * S);
        assert_eq!(world.oracle.problems, [""; 0]);
        let large = |package: &&oracle::Posted| package.from == 0 && package.head.len > 30_000;
        let left = world.oracle.packages.iter().filter(large).filter(|package| !package.said_lost).count();
        assert!(left > 3, "{left} large packages left by the slow line");
        assert_eq!(world.nodes[0].attempts, 1, "seed {seed}: one connection, all the time");
        assert!(world.nodes[0].client.is_up());
    }
}

const _: () = assert!(WELL_NS > 2 * BACKOFF_MAX_NS && MS < S);
