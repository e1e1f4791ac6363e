//! Sequences of events in a system. The world checks at each moment; a scene states the result and its deadline.

use super::world::{Conditions, MS, SECOND, World};
use crate::time::STEP_MIN_NS;
use std::time::Duration;

const INTERVAL: u64 = 100 * MS;
const AGREED_NS: u64 = 3 * MS;

type Scene = fn(&mut World);

pub(super) const SCENES: [(&str, Scene); 10] = [
    ("quiet", quiet),
    ("the master dies", the_master_dies),
    ("two masters die", two_masters_die),
    ("the master's router starts again", the_masters_router_starts_again),
    ("a computer starts again", a_computer_starts_again),
    ("a short split", a_short_split),
    ("a long split", a_long_split),
    ("a node hears nobody", a_node_hears_nobody),
    ("nodes stand still", nodes_stand_still),
    ("a clock is set", a_clock_is_set),
];

/// A system of four that agrees; a third of the seeds have a bad network, a third a very uneven one.
pub(super) fn begin(name: &str, seed: u64) -> World {
    let ways = match seed % 3 {
        0 => Conditions::LAN,
        1 => Conditions { loss: 50, twice: 20, jitter_ns: 200_000, ..Conditions::LAN },
        _ => Conditions { asymmetry_ns: 200_000, ..Conditions::LAN },
    };
    let mut world = World::new(seed, 4, &[0, 1, 2], Duration::from_nanos(INTERVAL), ways);
    world.replay = format!("scene \"{name}\", {}", world.replay);
    world.start_all();
    world.run_until(8 * INTERVAL + SECOND, "agreement at first", |world| world.agrees(AGREED_NS));
    world
}

fn agrees_again(world: &mut World, within_ns: u64) {
    world.run_until(within_ns, "agreement again", |world| world.agrees(AGREED_NS));
}

fn quiet(world: &mut World) {
    world.run(30 * SECOND);
    assert!(world.begun.len() == 1 && world.epoch(3) == 1, "{}", world.replay);
}

fn the_master_dies(world: &mut World) {
    for _ in 0..4 {
        let [master] = world.masters_now()[..] else { return world.fail("no master, or two") };
        world.kill(master);
        world.run_until(5 * INTERVAL, "takeover by the next", |world| !world.masters_now().is_empty());
        agrees_again(world, SECOND);
        world.run(SECOND);
        world.start(master);
        world.run(2 * SECOND);
        if world.masters_now().contains(&master) {
            world.fail("a node that returns stays a slave");
        }
    }
    if world.epoch(3) != 1 {
        world.fail("masters came and went, and so did an epoch");
    }
}

fn two_masters_die(world: &mut World) {
    world.run(SECOND);
    world.kill(0);
    world.kill(1);
    world.run_until(6 * INTERVAL, "takeover by the one after the next", |world| world.masters_now() == [2]);
    agrees_again(world, SECOND);
    world.kill(2);
    // No candidate for master is left: the last one continues by its own clock, and its bound says so.
    world.run(20 * SECOND);
    let reading = world.clock(3).reading(world.local_ns(3));
    if !reading.synchronised || reading.time.error < Duration::from_micros(20) {
        world.fail("a bound that does not grow");
    }
    world.start(1);
    world.run_until(2 * SECOND, "agreement with a node that knows the time no better", |world| world.agrees(50 * MS));
}

fn the_masters_router_starts_again(world: &mut World) {
    for _ in 0..3 {
        world.run(SECOND);
        let [master] = world.masters_now()[..] else { return world.fail("no master, or two") };
        world.kill(master);
        world.run(INTERVAL);
        world.start(master);
        agrees_again(world, 5 * INTERVAL + SECOND);
    }
    (0..4).for_each(|node| world.kill(node));
    world.run(SECOND);
    world.start_all();
    agrees_again(world, 8 * INTERVAL + SECOND);
    if world.epoch(0) != 1 {
        world.fail("all routers started again, and time did not go on");
    }
}

fn a_computer_starts_again(world: &mut World) {
    for node in [3, 0, 1] {
        world.switch_off(node);
        world.run(SECOND);
        world.start(node);
        agrees_again(world, 5 * INTERVAL + SECOND);
    }
    (0..4).for_each(|node| world.kill(node));
    world.switch_off(0);
    world.start(0);
    world.run(INTERVAL);
    // The others have time, so one of them is master, though the first in order started before them.
    (1..4).for_each(|node| world.start(node));
    agrees_again(world, 12 * INTERVAL + SECOND);
}

fn a_short_split(world: &mut World) {
    for side in [&[0_u8][..], &[0, 3], &[2, 3], &[1]] {
        world.split(side);
        world.run(3 * SECOND);
        world.heal();
        world.run_until(2 * INTERVAL, "one master after a split", |world| world.masters_now().len() == 1);
        agrees_again(world, 2 * SECOND);
    }
    if world.epoch(0) != 1 {
        world.fail("so small a difference is slewed");
    }
}

fn a_long_split(world: &mut World) {
    world.split(&[0, 3]);
    world.run(120 * SECOND);
    let time = |world: &World, node| i128::from(world.clock(node).reading(world.local_ns(node)).time.ns);
    let apart_ns = (time(world, 0) - time(world, 2)).unsigned_abs();
    world.heal();
    world.run_until(2 * INTERVAL, "one master after a long split", |world| world.masters_now().len() == 1);
    agrees_again(world, 8 * SECOND);
    // Near the limit either is right: they drift while they are measured.
    let (steps, epoch) = (apart_ns > u128::from(STEP_MIN_NS), world.epoch(0));
    let is_near = apart_ns.abs_diff(u128::from(STEP_MIN_NS)) < u128::from(MS);
    if !is_near && epoch != 1 + u64::from(steps) {
        world.fail(&format!("{apart_ns} ns apart, and epoch {epoch}"));
    }
}

fn a_node_hears_nobody(world: &mut World) {
    for deaf in [0, 1, 2] {
        (0..4).filter(|from| *from != deaf).for_each(|from| world.cut(from, deaf));
        world.run(3 * SECOND);
        let followed = world.masters_now().into_iter().find(|master| *master != deaf);
        if followed.is_none() {
            world.fail("the others have no master that hears them");
        }
        world.heal();
        world.run_until(2 * INTERVAL, "one master when all hear again", |world| world.masters_now().len() == 1);
        agrees_again(world, 2 * SECOND);
    }
}

fn nodes_stand_still(world: &mut World) {
    for node in [3, 0, 1, 2] {
        world.freeze(node, 3 * SECOND);
        world.run(3 * SECOND + INTERVAL);
        world.run_until(2 * INTERVAL, "one master after a stand-still", |world| world.masters_now().len() == 1);
        agrees_again(world, 2 * SECOND);
    }
}

/// From 1970 to now, by an hour back, and by nothing: each is one epoch, and all follow.
fn a_clock_is_set(world: &mut World) {
    let years_ns = 56 * 365 * 86_400 * SECOND;
    for (epoch, by_ns) in [(2, -i128::from(years_ns)), (3, years_ns.into()), (4, -3_600 * i128::from(SECOND)), (5, 0)] {
        let [master] = world.masters_now()[..] else { return world.fail("no master, or two") };
        let now_ns = world.clock(master).reading(world.local_ns(master)).time.ns;
        let wall_ns = u64::try_from(i128::from(now_ns) + by_ns).unwrap();
        world.set_clock(master, wall_ns);
        let begun_ns = world.clock(master).reading(world.local_ns(master)).time.ns;
        assert!(begun_ns.abs_diff(wall_ns) < 1_000, "{}", world.replay);
        agrees_again(world, 3 * SECOND);
        world.run(15 * SECOND);
        if (0..4).any(|node| world.epoch(node) != epoch) {
            world.fail(&format!("each setting is one epoch: {epoch}"));
        }
    }
}
