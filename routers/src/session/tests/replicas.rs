//! Replicas by sessions, in simulated networks and with hostile ends.

mod hostile;
mod turns;

use super::ground::Ground;
use super::plan::Plan;
use super::world::rings::{PICTURE, POSE};
use super::world::{MS, S, World};
use super::{WELL_NS, all_seeds};
use crate::replication::{LINE_PART_BYTES, LINE_PART_ROOM};
use crate::session::ClientIndex;
use crate::session::server::ServerStep;
use std::collections::BTreeMap;

/// What both kernels hold of a line there.
const HELD_BYTES: u64 = 8 * 1024;
/// What must have been seen in each ten networks.
const SEEN_IN_TEN: [(&str, u64); 6] = [
    ("pictures", 1000),
    ("poses", 10_000),
    ("records back", 500),
    ("server restarted", 5),
    ("client restarted", 5),
    ("line faults", 50),
];

/// Problems of a network in which all goes wrong for a while, and then all must be well.
fn run(plan: Plan) -> World {
    let seed = plan.seed;
    let mut world = World::new(plan);
    world.run(15 * S);
    world.may_fail = false;
    world.run(S);
    world.may_post = false;
    world.run(WELL_NS);
    if world.oracle.problems.is_empty() {
        world.check_rings();
    }
    world.oracle.problems.iter_mut().for_each(|problem| *problem = format!("seed {seed}, {problem}"));
    world
}

#[test]
fn records_are_whole_or_told_and_the_newest_is_next_whatever_goes_wrong() {
    all_seeds(run, Plan::replicated, &SEEN_IN_TEN);
}

/// Bytes a ms of each line: a fourth of the pictures, and all poses.
const NARROW: u64 = 50;

fn narrow(seed: u64, has_replicas: bool) -> World {
    let plan = Plan::replicated(seed);
    let lines = vec![NARROW; plan.clients];
    let mut world = World::new(Plan { calm: true, lines, has_replicas, ..plan });
    world.run(20 * S);
    assert_eq!(world.oracle.problems, [""; 0], "seed {seed}");
    world
}

#[test]
fn pictures_come_whole_by_a_line_that_is_much_too_slow_and_poses_pass_them() {
    for seed in 0..3 {
        let world = narrow(seed, true);
        for client in 0..world.nodes.len() {
            let [pictures, poses] = [PICTURE, POSE].map(|place| world.records(client, place));
            // Each has 20 kB on an average.
            assert!(pictures > 10 * NARROW / 20, "seed {seed}: {pictures} pictures of client {client}");
            assert!(poses > 3 * pictures, "seed {seed}: {poses} poses beside {pictures} pictures of client {client}");
        }
    }
}

#[test]
fn a_package_waits_for_one_part_at_most_and_what_the_kernel_has() {
    for seed in 0..3 {
        let last = |has_replicas: bool| {
            let world = narrow(seed, has_replicas);
            let mut ages: Vec<u64> = world.oracle.log.iter().map(|(age_ns, ..)| *age_ns).collect();
            ages.sort_unstable();
            assert!(ages.len() > 100, "seed {seed}: {} packages", ages.len());
            ages[ages.len() * 9 / 10]
        };
        // Both ways.
        let waits_ns = 2 * (HELD_BYTES + LINE_PART_ROOM as u64) / NARROW * MS;
        let (alone_ns, beside_ns) = (last(false), last(true));
        assert!(beside_ns <= alone_ns + waits_ns, "seed {seed}: {beside_ns} ns, without replicas {alone_ns} ns");
    }
}

/// Else the line would be measured while nothing is to be sent, and be taken for slow.
#[test]
fn behind_the_last_part_nothing_waits() {
    let mut ground = Ground::replicated(2);
    let mut waited: BTreeMap<ClientIndex, Vec<bool>> = BTreeMap::new();
    for ms in [100, 200, 300] {
        assert!(ground.said.rings.as_mut().unwrap().write(ms));
        loop {
            let index = match ground.server.poll(ground.now_ns, &mut ground.said) {
                ServerStep::Write(index) => index,
                ServerStep::Look => continue,
                ServerStep::Close(_) | ServerStep::Wait { .. } => break,
            };
            waited.entry(index).or_default().push(ground.server.has_waiting(index));
            let bytes = ground.server.ready(index).len();
            ground.server.took(ground.now_ns, index, bytes);
        }
        assert!(waited.len() == 2 && waited.values().all(|waited| waited.last() == Some(&false)), "{waited:?}");
    }
    assert!(waited.values().all(|waited| waited.contains(&true)), "{waited:?}");
}

const _: () = assert!(LINE_PART_BYTES <= HELD_BYTES as usize);
