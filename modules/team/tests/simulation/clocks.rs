//! Offsets of clocks that are years apart and drift, over one and several hops.

use crate::world::{BEAT_NS, GOOD, MS_NS, RANGE_MM, World, id, seeds, settings};
use rohrpost_team::group::Notice;
use rohrpost_team::time::Offset;
use rohrpost_team::{Position, RobotId};
use rohrpost_testbed::sim::link::Quality;

fn error_ns(world: &World, from: RobotId, to: RobotId, offset: Offset) -> u64 {
    offset.apply(world.clock_ns(from)).abs_diff(world.clock_ns(to))
}

fn chain(seed: u64, quality: Quality) -> World {
    let mut world = World::new(seed, quality, settings(75));
    (1..=4).for_each(|system| world.add(id(system), i32::from(system) * RANGE_MM as i32));
    world.run_beats(20);
    world
}

#[test]
fn errors_of_offsets_are_always_within_their_bounds() {
    for seed in seeds() {
        let loss_ppm = [0, 100_000, 300_000][seed as usize % 3];
        let jitter_ns = [0, 19 * MS_NS, 600 * MS_NS][seed as usize / 3 % 3];
        let mut world = chain(seed, Quality { loss_ppm, jitter_ns, reorder_ppm: 50_000, ..GOOD });
        let mut known = 0;
        for step in 0..100 {
            if step == 50 {
                // A restarted robot may have another clock.
                world.kill(id(1));
                let clock_ns = world.chance.below(1 << 60);
                world.robots.get_mut(&id(1)).unwrap().clock =
                    rohrpost_testbed::sim::clock::Clock::new(clock_ns, 0, 30_000);
                world.restart(id(1), true);
            }
            for from in world.alive().collect::<Vec<_>>() {
                let (team, now_ns) = (world.team(from), world.clock_ns(from));
                let others = world.alive().filter_map(|to| Some((to, team.neighbour_clock(now_ns, to)?)));
                let leader = team.group().leader(now_ns);
                for (to, offset) in others.chain(team.team_clock(now_ns).map(|offset| (leader, offset))) {
                    // A robot cannot know of a restart before it has heard of it.
                    let run = team.group().run(to).map(|run| run.incarnation);
                    if run == Some(world.team(to).group().version().incarnation) {
                        let error_ns = error_ns(&world, from, to, offset);
                        assert!(error_ns <= offset.bound_ns, "seed {seed}: {from} of {to}: {error_ns} ns, {offset:?}");
                        known += 1;
                    }
                }
            }
            world.run_until(world.now_ns + BEAT_NS / 3);
        }
        assert!(known > 500, "seed {seed}: {known}");
    }
}

#[test]
fn with_equal_delays_both_ways_an_error_is_within_a_delay_and_a_millisecond() {
    for seed in seeds() {
        let delay_ns = MS_NS << (seed % 6);
        let world = chain(seed, Quality { delay_ns, jitter_ns: 0, ..GOOD });
        for from in [2, 3, 4] {
            let (from, to, now_ns) = (id(from), id(from - 1), world.clock_ns(id(from)));
            let near = world.team(from).neighbour_clock(now_ns, to).unwrap();
            let error_ns = error_ns(&world, from, to, near);
            assert!(error_ns <= delay_ns + MS_NS, "seed {seed}: {error_ns} ns, {delay_ns} ns a way");
            let hops = u64::from(from.get() - 1);
            let leader = world.team(from).team_clock(now_ns).unwrap();
            assert!(leader.bound_ns <= hops * (delay_ns + MS_NS), "seed {seed}: {leader:?}, {hops} hops");
        }
    }
}

#[test]
fn a_clock_that_is_years_off_is_told_and_harms_nothing() {
    let mut world = World::new(3, GOOD, settings(45));
    (1..=3).for_each(|system| world.add(id(system), 0));
    world.see(id(1), Position { x_mm: 0, y_mm: 50_000 });
    world.run_beats(8);
    assert_eq!(world.wrong(), []);
    assert!(world.views_are_equal());
    let notices = world.team(id(2)).group().notices();
    assert!(notices.contains(&Notice::ClockOff(id(1))) && notices.contains(&Notice::ClockOff(id(3))));
    let object = &world.team(id(2)).view().objects()[0];
    let age_ns = world.clock_ns(id(2)) - object.seen_ns;
    let true_ns = 8 * BEAT_NS;
    assert!(age_ns <= true_ns && age_ns + 100 * MS_NS >= true_ns, "{age_ns} ns, of {true_ns}");
}
