//! Small maps, on which all can be tried.

use crate::drawn::Crossing;
use crate::exhaustive::least_cost;
use crate::valid::check;
use rohrpost_team::coordination::{NoWays, Trip, plan_ways};
use rohrpost_team::grid::{Direction, Obstacle, ObstacleKind};
use rohrpost_testbed::sim::chance::Chance;

const MAPS: u64 = 150;
/// More than there are steps of all robots from all places.
const LOOKS_MAX: u32 = 4_000_000;

/// Obstacles where no robot starts or ends.
fn obstacles(chance: &mut Chance, crossing: &Crossing) -> Vec<Obstacle> {
    let count = chance.below(3) as usize;
    let mut kind = || match chance.below(3) {
        0 => ObstacleKind::Moving(chance.pick(&Direction::ALL)),
        _ => ObstacleKind::Stopped,
    };
    crossing.others.iter().take(count).map(|cell| Obstacle { cell: *cell, kind: kind() }).collect()
}

#[test]
fn what_an_exhaustive_search_solves_is_solved_and_nothing_else() {
    let (mut solved, mut impossible, mut parted) = (0, 0, 0);
    for seed in 0..MAPS {
        let mut chance = Chance::new(seed);
        let robots = chance.between(2, 4) as usize;
        let (side, walls) = if robots == 4 { (3, 15) } else { (4, 35) };
        let crossing = Crossing::new(seed, side, walls, robots);
        let frozen = obstacles(&mut chance, &crossing);
        let Crossing { grid, trips, .. } = &crossing;
        let what = format!("map {seed}: {grid:?} {trips:?} {frozen:?}");
        let least = least_cost(grid, &frozen, trips);
        match plan_ways(grid, &frozen, trips, LOOKS_MAX) {
            Ok(ways) => {
                check(grid, &frozen, trips, &ways, &what);
                assert!(least.is_some(), "{what}");
                solved += 1;
            }
            Err(NoWays::Impossible) => {
                assert_eq!(least, None, "{what}");
                impossible += 1;
            }
            Err(NoWays::Parted { .. }) => {
                assert_eq!(least, None, "{what}");
                parted += 1;
            }
            Err(error) => panic!("{error}: {what}"),
        }
    }
    eprintln!("{solved} solved, {impossible} impossible, {parted} parted");
    assert!(solved > 20 && impossible > 5 && parted > 5, "{solved} {impossible} {parted}");
}

#[test]
fn up_to_four_robots_need_a_tenth_more_than_the_least_at_most() {
    let (mut steps, mut least_steps, mut worst) = (0, 0, 1.0_f64);
    for seed in 0..MAPS {
        let robots = 1 + seed as usize % 4;
        let side = if robots == 4 { 3 } else { 4 };
        let Crossing { grid, trips, .. } = Crossing::new(1000 + seed, side, 15, robots);
        let Ok(ways) = plan_ways(&grid, &[], &trips, 5_000) else { continue };
        // Robots that wait at their goals, to leave them once more, cost nothing there.
        let least = least_cost(&grid, &[], &trips).unwrap();
        (steps, least_steps) = (steps + ways.steps(), least_steps + least);
        worst = worst.max(ways.steps() as f64 / least.max(1) as f64);
    }
    eprintln!("{steps} steps, {least_steps} at least; worst {worst}");
    assert!(steps * 10 <= least_steps * 11, "{steps} steps, {least_steps} at least");
}

/// A row of three with one place beside it: four trips that need it, and one that cannot be.
#[test]
fn robots_exchange_places_if_one_can_step_aside() {
    let map = |text: &str| rohrpost_team::grid::Map::read(text.as_bytes()).unwrap().grid;
    let swap = ["0,0 3,0", "3,0 0,0"].map(|trip| {
        let (from, to) = trip.split_once(' ').unwrap();
        Trip { from: from.parse().unwrap(), to: to.parse().unwrap() }
    });
    assert_eq!(plan_ways(&map("....\n****\n"), &[], &swap, LOOKS_MAX), Err(NoWays::Impossible));
    for beside in ["*.**", "**.*", "*..*"] {
        let grid = map(&format!("....\n{beside}\n"));
        let ways = plan_ways(&grid, &[], &swap, LOOKS_MAX).unwrap();
        check(&grid, &[], &swap, &ways, beside);
    }
}
