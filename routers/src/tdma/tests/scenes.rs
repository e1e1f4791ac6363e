//! Scenes of three nodes on one wire.

use super::world::{CYCLE, MS, SECOND, US, World};
use crate::frame::NodeIndex;
use crate::tdma::Silent;
use crate::time::Role;

/// How many seeds each scene is run with: `ROHRPOST_TIME_SEEDS`, else a few.
fn seeds() -> std::ops::Range<u64> {
    let asked = std::env::var("ROHRPOST_TIME_SEEDS").ok().and_then(|seeds| seeds.parse().ok());
    0..asked.unwrap_or(3)
}

/// Three nodes that agree.
fn agreed(seed: u64) -> World {
    let mut world = World::new(seed);
    world.start_all();
    assert!(world.run_until(2 * SECOND, World::agrees), "seed {seed}: no agreement at first: {}", tell(&world));
    world.run(SECOND);
    world
}

fn tell(world: &World) -> String {
    let node = |node: NodeIndex| {
        let clock = world.nodes[usize::from(node)].clock.as_ref()?;
        Some(format!(
            "{node}: {:?} of {:?}, {:?}, {:?}\n",
            clock.role(),
            clock.term(),
            world.silent(node),
            world.counts(node)
        ))
    };
    (0..3).filter_map(node).collect()
}

fn holds(world: &World, seed: u64) {
    world.assert_alone(&format!("seed {seed}; {}", tell(world)));
}

#[test]
fn nodes_join_one_by_one_and_never_meet() {
    for seed in seeds() {
        let mut world = World::new(seed);
        world.stalls = 50;
        for node in [0, 2, 1] {
            world.start(node);
            world.run(SECOND);
        }
        world.run(4 * SECOND);
        assert!(world.agrees(), "seed {seed}: {}", tell(&world));
        holds(&world, seed);
        let counts = world.counts(2);
        assert!(counts.late > 0 && counts.used > 500, "seed {seed}: {counts:?}");
        // A master's Syncs leave in its window alone; each cycle has one for each other node.
        let first = world.counts(0).syncs;
        assert!(first.sent > 900 && first.replacements_sent == 0, "seed {seed}: {first:?}");
    }
}

/// The master dies when it has just sent its Syncs of a cycle. Returns when that was.
fn dies_after_sync(world: &mut World, master: NodeIndex) -> u64 {
    let sent = world.counts(master).syncs.sent;
    assert!(world.run_until(2 * CYCLE, |world| world.counts(master).syncs.sent > sent), "a master sends");
    world.kill(master);
    world.now
}

/// The other of two masters stands in, and replaces the dead one; returns when, after its last Sync.
fn is_replaced(world: &mut World, other: NodeIndex, died: u64) -> [u64; 2] {
    let (before, term) = (world.counts(other).syncs.replacements_sent, world.clock(2).term());
    let stands_in = |world: &World| world.counts(other).syncs.replacements_sent > before;
    assert!(world.run_until(3 * CYCLE, stands_in), "no replacement: {}", tell(world));
    let stood_in = world.now;
    assert_eq!(world.clock(2).term(), term, "the role has not changed yet");
    let is_master = |world: &World| world.clock(other).role() == Role::Master;
    assert!(world.run_until(5 * CYCLE, is_master), "no takeover: {}", tell(world));
    [stood_in - died, world.now - died]
}

#[test]
fn a_master_dies_and_no_slot_is_lost() {
    for seed in seeds() {
        let mut world = agreed(seed);
        assert_eq!(world.counts(1).syncs.replacements_sent, 0, "seed {seed}: the master was heard each time");
        let before = [world.counts(1), world.counts(2)];
        let died = dies_after_sync(&mut world, 0);
        let [stood_in, reigned] = is_replaced(&mut world, 1, died);
        assert!(stood_in < CYCLE + MS, "seed {seed}: stood in after {stood_in} ns");
        assert!((3 * CYCLE..3 * CYCLE + MS).contains(&reigned), "seed {seed}: reigned after {reigned} ns");
        world.run(SECOND);
        assert!(world.agrees(), "seed {seed}: {}", tell(&world));
        for (node, before) in [(1, before[0]), (2, before[1])] {
            let counts = world.counts(node);
            let lost = (counts.silent - before.silent, counts.skipped - before.skipped, counts.late - before.late);
            assert_eq!(lost, (0, 0, 0), "seed {seed}: node {node}: {}", tell(&world));
        }
        assert_eq!(world.counts(2).syncs.replacements_heard, 2, "seed {seed}");
        // A node that returns listens first, and is a slave.
        world.start(0);
        world.run(SECOND);
        assert!(world.agrees() && world.clock(1).role() == Role::Master, "seed {seed}: {}", tell(&world));
        // Its window lies before that of the second: in this one it knows what was missing in the cycle before.
        let died = dies_after_sync(&mut world, 1);
        let [stood_in, reigned] = is_replaced(&mut world, 0, died);
        assert!(stood_in < 2 * CYCLE, "seed {seed}: stood in after {stood_in} ns");
        assert!(reigned < 4 * CYCLE, "seed {seed}: reigned after {reigned} ns");
        world.run(SECOND);
        assert!(world.agrees(), "seed {seed}: {}", tell(&world));
        holds(&world, seed);
    }
}

#[test]
fn a_master_of_which_two_syncs_are_missing_remains_it() {
    for seed in seeds() {
        for (master, other) in [(0, 1), (1, 0)] {
            let mut world = agreed(seed);
            if master == 1 {
                let died = dies_after_sync(&mut world, 0);
                is_replaced(&mut world, 1, died);
                world.start(0);
                world.run(SECOND);
            }
            let term = world.clock(master).term();
            for _ in 0..20 {
                let sent = world.counts(master).syncs.sent;
                world.run_until(2 * CYCLE, |world| world.counts(master).syncs.sent > sent);
                world.cut[usize::from(master)][usize::from(other)] = true;
                world.run_until(3 * CYCLE, |world| world.counts(master).syncs.sent == sent + 3);
                world.cut = [[false; 3]; 3];
                world.run(6 * CYCLE);
            }
            assert_eq!(world.clock(master).term(), term, "seed {seed}: {}", tell(&world));
            assert!(world.counts(other).syncs.missed >= 40, "seed {seed}: {}", tell(&world));
            assert!(world.agrees(), "seed {seed}: {}", tell(&world));
            holds(&world, seed);
        }
    }
}

#[test]
fn a_master_that_wakes_up_late_in_its_synchronisation_window_synchronises() {
    for (late_us, sends) in [(110, true), (170, false)] {
        let mut world = agreed(7);
        let counts = world.counts(0);
        for _ in 0..2 {
            // The window is 150 µs long without its guard.
            world.wakes_late_to_synchronise(0, late_us * US);
            world.run(CYCLE / 2);
        }
        let (late, stood_in) = (world.counts(0), world.counts(1).syncs.replacements_sent);
        let synchronised = (late.syncs.sent - counts.syncs.sent, late.synchronisations_late, stood_in > 0);
        assert_eq!(
            synchronised,
            if sends { (2, 0, false) } else { (0, 2, true) },
            "{late_us} µs late: {}",
            tell(&world)
        );
        world.run(SECOND);
        holds(&world, 7);
    }
}

#[test]
fn a_master_with_packages_that_come_lives() {
    for seed in seeds() {
        let mut world = agreed(seed);
        let term = world.clock(0).term();
        (world.cut[0][1], world.packages_come) = (true, true);
        world.run(10 * CYCLE);
        assert_eq!(
            (world.clock(1).term(), world.clock(1).role()),
            (term, Role::Slave),
            "seed {seed}: {}",
            tell(&world)
        );
        assert!(world.counts(1).syncs.replacements_sent >= 9, "seed {seed}: its Syncs are missing all the same");
        world.packages_come = false;
        let is_master = |world: &World| world.clock(1).role() == Role::Master;
        assert!(world.run_until(4 * CYCLE, is_master), "seed {seed}: nothing comes any more: {}", tell(&world));
    }
}

#[test]
fn two_masters_become_one() {
    for seed in seeds() {
        let mut world = agreed(seed);
        for other in [0, 2] {
            (world.cut[1][other], world.cut[other][1]) = (true, true);
        }
        // 0.4 ms apart in the end.
        world.warms(1, 20_000);
        world.run(20 * SECOND);
        let masters = |world: &World| (0..2).filter(|node| world.clock(*node).role() == Role::Master).count();
        assert_eq!(masters(&world), 2, "seed {seed}: both sides have one");
        world.cut = [[false; 3]; 3];
        assert!(world.run_until(3 * CYCLE, |world| masters(world) == 1), "seed {seed}: {}", tell(&world));
        world.run(CYCLE);
        world.collisions.clear();
        world.run(10 * SECOND);
        assert!(world.agrees(), "seed {seed}: {}", tell(&world));
        // A node that yields is silent until it has measured.
        holds(&world, seed);
    }
}

#[test]
fn a_node_that_hears_nobody_holds_over_then_falls_silent() {
    for seed in seeds() {
        let mut world = agreed(seed);
        // A longer measurement gives a more exact rate.
        world.run(10 * SECOND);
        (world.cut[0][2], world.cut[1][2]) = (true, true);
        let silent = |world: &World| matches!(world.silent(2), Some(Silent::BoundTooLarge { .. }));
        assert!(!world.run_until(2 * SECOND, silent), "seed {seed}: it holds over");
        assert!(world.run_until(200 * SECOND, silent), "seed {seed}: it never falls silent");
        let used = world.counts(2).used;
        world.run(SECOND);
        assert_eq!(world.counts(2).used, used, "seed {seed}");
        world.cut = [[false; 3]; 3];
        assert!(world.run_until(SECOND, |world| world.silent(2).is_none()), "seed {seed}: {}", tell(&world));
        holds(&world, seed);
    }
}

#[test]
fn a_master_that_stands_still_is_replaced_and_follows() {
    for seed in seeds() {
        let mut world = agreed(seed);
        world.nodes[0].frozen_until = world.now + 100 * MS;
        world.run(2 * SECOND);
        assert!(world.agrees() && world.clock(1).role() == Role::Master, "seed {seed}: {}", tell(&world));
        holds(&world, seed);
    }
}

#[test]
fn in_quiet_times_frames_start_where_slots_do() {
    let mut world = agreed(3);
    let begins = world.wire.len();
    world.run(2 * SECOND);
    let counts = world.counts(2);
    assert!(counts.used > 400 && world.wire[begins..].iter().any(|frame| frame.from == 2 && !frame.is_time));
    let lead = world.nodes[2].scheduler.lead_ns();
    assert!(lead.1 >= 3 * US && lead.1 <= lead.0, "{lead:?}");
    holds(&world, 3);
}

/// The clock of the master's computer is set, from 1970 to now and back by an hour and a bit: windows stay where they
/// are, whatever the new time is.
#[test]
fn nodes_never_meet_when_the_masters_clock_is_set_and_send_again_in_the_new_epoch() {
    let years_ns = 56 * 365 * 86_400 * i128::from(SECOND);
    for seed in seeds() {
        let mut world = agreed(seed);
        for by_ns in [years_ns + 3_333_333, -3_600 * i128::from(SECOND) - 1_234_567] {
            let local_ns = world.nodes[0].local_ns(world.now);
            let clock = world.nodes[0].clock.as_mut().unwrap();
            let (epoch, now_ns) = (clock.record().epoch, clock.reading(local_ns).time.ns);
            let wall_ns = u64::try_from(i128::from(now_ns) + by_ns).unwrap();
            assert!(clock.begin_time(local_ns, wall_ns), "node 0 is the master");
            let set_ns = clock.reading(local_ns).time.ns;
            let off_ns = set_ns.abs_diff(now_ns) % CYCLE;
            let is_whole = off_ns < US || CYCLE - off_ns < US;
            assert!(set_ns.abs_diff(wall_ns) <= CYCLE && is_whole, "by whole cycles: {off_ns} ns");
            world.run(CYCLE);
            let follows = |world: &World| (0..3).all(|node| world.clock(node).record().epoch == epoch + 1);
            assert!(
                world.run_until(3 * SECOND, |world| follows(world) && world.agrees()),
                "seed {seed}: {}",
                tell(&world)
            );
            let before = world.counts(2).used;
            world.run(SECOND);
            assert!(world.counts(2).used > before + 50, "seed {seed}: {}", tell(&world));
            let missed = |node| world.counts(node).skipped + world.counts(node).syncs.missed;
            assert!((0..3).all(|node| missed(node) < 1_000), "no cycle passed in between: {}", tell(&world));
        }
        holds(&world, seed);
    }
}
