//! Groups that come into range of each other, all at once.

use crate::world::{BEAT_NS, GOOD, MS_NS, RANGE_MM, World, id, seeds, settings};
use rohrpost_team::Position;
use rohrpost_testbed::sim::link::Quality;

/// Two to eight groups of one to three robots, each with its own intruder, that are at one place after ten beats.
fn merged(seed: u64, quality: Quality, max_age_tenths: u64) -> World {
    let mut world = World::new(seed, quality, settings(max_age_tenths));
    let groups = world.chance.between(2, 8) as i32;
    let mut free: Vec<u8> = (1..=254).collect();
    for group in 0..groups {
        for _ in 0..world.chance.between(1, 3) {
            let index = world.chance.below(free.len() as u64) as usize;
            let robot = id(free.swap_remove(index));
            world.add(robot, group * 2 * RANGE_MM as i32);
        }
    }
    world.run_beats(5);
    for robot in world.alive().collect::<Vec<_>>() {
        if world.pair(robot).0 == robot {
            let place = Position { x_mm: i32::from(robot.get()) * 1000, y_mm: 50_000 };
            world.see(robot, place);
        }
    }
    world.run_beats(10);
    for robot in world.alive().collect::<Vec<_>>() {
        world.move_to(robot, 0);
        world.robots.get_mut(&robot).unwrap().synchros = 0;
    }
    world
}

#[test]
fn without_loss_the_pair_is_right_within_two_beats_and_views_three_later() {
    let (mut synchros, mut robots, mut pairs, mut views, mut most) = (0, 0, 0, 0, 0.0_f64);
    for seed in seeds() {
        // Delays of any length up to nine tenths of a beat.
        let jitter_ns = [19 * MS_NS, BEAT_NS * 9 / 10][seed as usize % 2];
        let mut world = merged(seed, Quality { jitter_ns, ..GOOD }, 45);
        let (pair, view) = right_from(&mut world, 40);
        let pair = pair.unwrap_or_else(|| panic!("seed {seed}: {:?} are wrong", world.wrong()));
        let view = view.unwrap_or_else(|| panic!("seed {seed}: views differ"));
        assert!(pair <= 8, "seed {seed}: right after {pair} quarters of a beat");
        assert!(view <= pair + 12, "seed {seed}: views equal after {view} quarters, pairs after {pair}");
        (pairs, views) = (pair.max(pairs), view.max(views));
        synchros += world.synchros();
        robots += world.robots.len() as u32;
        most = most.max(f64::from(world.synchros()) / world.robots.len() as f64);
        let before = world.synchros();
        world.run_beats(20);
        assert_eq!(world.synchros(), before, "seed {seed}: a converged team sends no synchro");
        for robot in world.alive() {
            assert!(world.team(robot).agrees(world.clock_ns(robot)), "seed {seed}: {robot} does not know it");
        }
    }
    let mean = f64::from(synchros) / f64::from(robots);
    println!("pairs right after {pairs} quarters of a beat at most, views after {views}");
    println!("{mean:.2} synchros a robot in the mean, {most:.2} in the worst merge");
    assert!(mean <= 2.0);
}

/// From which quarter of a beat on pairs are right, and views equal, to the end.
pub(crate) fn right_from(world: &mut World, quarters: u32) -> (Option<u32>, Option<u32>) {
    let (mut pair, mut view) = (None, None);
    for quarter in 0..quarters {
        pair = if world.wrong().is_empty() { pair.or(Some(quarter)) } else { None };
        view = if world.views_are_equal() { view.or(Some(quarter)) } else { None };
        world.run_until(world.now_ns + BEAT_NS / 4);
    }
    (pair, view)
}

#[test]
fn at_thirty_percent_loss_pairs_are_right_after_four_beats_and_stay_so() {
    let (mut slow, mut runs, mut wrong, mut moments, mut views) = (0, 0_u32, 0, 0_u32, 0);
    for seed in seeds() {
        let mut world = merged(seed, Quality { loss_ppm: 300_000, ..GOOD }, 75);
        world.run_beats(4);
        slow += u32::from(!world.wrong().is_empty());
        runs += 1;
        for _ in 0..80 {
            wrong += world.wrong().len() as u32;
            moments += world.robots.len() as u32;
            world.run_until(world.now_ns + BEAT_NS / 4);
        }
        views += u32::from(!world.views_are_equal());
    }
    println!("after 4 beats {slow} of {runs} not right; later {wrong} of {moments} moments; {views} views differ");
    assert!(slow * 100 <= runs, "{slow} of {runs} merges are not right after 4 beats");
    assert!(wrong * 100 < moments, "{wrong} of {moments} moments are wrong later");
    assert_eq!(views, 0, "views are equal 24 beats after the merge");
}

#[test]
fn delays_beyond_a_beat_copies_and_reordering_do_no_harm() {
    for seed in seeds() {
        let quality = Quality { jitter_ns: 600 * MS_NS, copy_ppm: 100_000, reorder_ppm: 100_000, ..GOOD };
        let mut world = merged(seed, Quality { loss_ppm: [0, 100_000][seed as usize % 2], ..quality }, 75);
        let right = world.holds_from(80, |world| world.wrong().is_empty());
        assert!(right.is_some_and(|right| right <= 32), "seed {seed}: {right:?}, {:?} are wrong", world.wrong());
        world.radio.set_quality(GOOD);
        world.run_beats(20);
        assert!(world.views_are_equal(), "seed {seed}");
        let before = world.synchros();
        world.run_beats(10);
        assert_eq!(world.synchros(), before, "seed {seed}: a converged team sends no synchro");
    }
}
