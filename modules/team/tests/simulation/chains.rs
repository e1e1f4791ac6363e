//! Robots in a row, each of which hears only the next ones; and links that go one way.

use crate::merges::right_from;
use crate::world::{BEAT_NS, GOOD, RANGE_MM, World, id, seeds, settings};
use rohrpost_team::{Position, RobotId};
use rohrpost_testbed::sim::link::Quality;

/// Ids of a row by chance.
fn chain(seed: u64, count: usize, quality: Quality, max_age_tenths: u64) -> (World, Vec<RobotId>) {
    let mut world = World::new(seed, quality, settings(max_age_tenths));
    let mut row = Vec::new();
    while row.len() < count {
        let robot = id(world.chance.between(1, 254) as u8);
        if !row.contains(&robot) {
            world.add(robot, row.len() as i32 * RANGE_MM as i32);
            row.push(robot);
        }
    }
    (world, row)
}

/// An end of the chain is taken for dead if hellos are lost seven times in a row, or nearly so on several links: that
/// is one case in some millions.
#[test]
fn a_settled_chain_of_six_stays_right_at_ten_percent_loss() {
    let (mut wrong, mut moments) = (0, 0);
    for seed in seeds() {
        let (mut world, _) = chain(seed, 6, Quality { loss_ppm: 100_000, ..GOOD }, 75);
        world.run_beats(20);
        for _ in 0..200 {
            wrong += world.wrong().len();
            moments += world.robots.len();
            world.run_until(world.now_ns + BEAT_NS / 2);
        }
    }
    println!("{wrong} of {moments} moments are wrong");
    assert!(wrong * 100_000 <= moments, "{wrong} of {moments} moments are wrong");
}

#[test]
fn the_dead_end_of_a_chain_is_a_ghost_for_max_age_and_diameter_at_most() {
    let mut worst = 0_u32;
    for seed in seeds() {
        let (mut world, row) = chain(seed, 6, Quality { loss_ppm: 100_000, ..GOOD }, 75);
        let end = row[0];
        world.run_beats(20);
        world.kill(end);
        let is_forgotten = |world: &World| {
            let knows = |robot: RobotId| world.team(robot).group().fresh(world.clock_ns(robot)).any(|it| it.0 == end);
            !world.alive().any(knows)
        };
        let forgotten = world.holds_from(80, is_forgotten).unwrap_or_else(|| panic!("seed {seed}: a ghost"));
        // Of the first beat a quarter or more is over when it dies; four others are on the way.
        assert!(forgotten <= 4 * 12 + 2, "seed {seed}: a ghost for {forgotten} quarters of a beat");
        assert_eq!(world.wrong(), [], "seed {seed}");
        worst = forgotten.max(worst);
    }
    println!("a ghost for at most {worst} quarters of a beat");
}

#[test]
fn views_of_a_chain_are_equal_after_its_diameter_and_three_beats() {
    let (mut late, mut views) = (0_u32, 0);
    for seed in seeds() {
        let (mut world, row) = chain(seed, 6, GOOD, 45);
        for robot in row {
            world.see(robot, Position { x_mm: i32::from(robot.get()) * 1000, y_mm: 90_000 });
        }
        let (pair, view) = right_from(&mut world, 120);
        let (pair, view) = (pair.unwrap(), view.unwrap());
        (late, views) = (view.saturating_sub(pair).max(late), view.max(views));
        assert!(view <= 4 * (5 + 3), "seed {seed}: views equal after {view} quarters, ids after {pair}");
        let before = world.synchros();
        world.run_beats(20);
        assert_eq!(world.synchros(), before, "seed {seed}");
        assert!(world.alive().all(|robot| world.team(robot).agrees(world.clock_ns(robot))), "seed {seed}");
    }
    println!("views equal after {views} quarters of a beat at most, {late} after the ids");
}

#[test]
fn a_link_that_goes_one_way_is_no_cause_for_synchros() {
    for seed in seeds() {
        let (mut world, row) = chain(seed, 3, GOOD, 45);
        // The third hears the first, which does not hear it; all hear each other through the second.
        world.move_to(row[2], RANGE_MM as i32 - 1);
        world.radio.shade(row[2], row[0]);
        world.move_to(row[1], RANGE_MM as i32 / 2);
        let place = Position { x_mm: 0, y_mm: 50_000 };
        world.see(row[2], place);
        world.run_beats(12);
        assert_eq!(world.wrong(), [], "seed {seed}");
        assert!(world.views_are_equal(), "seed {seed}");
        let before = world.synchros();
        world.run_beats(20);
        assert_eq!(world.synchros(), before, "seed {seed}");
        // Without the second, nobody can help the first: it is not tried again and again.
        world.kill(row[1]);
        world.see(row[2], Position { x_mm: 0, y_mm: 60_000 });
        world.run_beats(20);
        assert!(!world.views_are_equal() && world.synchros() <= before + 2, "seed {seed}: {}", world.synchros());
        let third = world.team(row[2]);
        assert!(!third.agrees(world.clock_ns(row[2])), "seed {seed}: it knows that views differ");
    }
}
