//! Drawn maps, goals and faults: whatever happens no two that hear each other are in one cell, and when it is calm
//! again all get to their goals.

use crate::world::{MS_NS, S_NS, SETTINGS, World};
use rohrpost_team::RobotId;
use rohrpost_team::coordination::TrafficSettings;
use rohrpost_team::grid::{Cell, Grid, Square, Wave};
use rohrpost_testbed::sim::chance::Chance;
use std::collections::BTreeMap;

fn seeds() -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().expect("a number"));
    let first = number("ROHRPOST_TRAFFIC_FIRST").unwrap_or(0);
    first..first + number("ROHRPOST_TRAFFIC").unwrap_or(20)
}

/// Paths that are connected with the first one of the largest part.
fn drawn_map(chance: &mut Chance) -> (Grid, Vec<Cell>) {
    loop {
        let side = chance.between(5, 9) as u32;
        let walls = chance.between(0, 30);
        let square = |_| if chance.percent(walls) { Square::Wall } else { Square::Path };
        let grid = Grid::new(side, (0..side * side).map(square).collect()).unwrap();
        let mut wave = Wave::default();
        let start = grid.cells().map(|(cell, _)| cell).find(|cell| grid.is_path(*cell));
        let Some(start) = start else { continue };
        wave.start(&grid, start, [], []);
        wave.next_goal();
        let part: Vec<Cell> =
            grid.cells().map(|(cell, _)| cell).filter(|cell| wave.distance(*cell).is_some()).collect();
        if part.len() >= 15 {
            return (grid, part);
        }
    }
}

fn drawn(cells: &[Cell], count: usize, chance: &mut Chance) -> Vec<Cell> {
    let mut cells = cells.to_vec();
    (0..count).map(|_| cells.swap_remove(chance.below(cells.len() as u64) as usize)).collect()
}

#[test]
fn no_two_that_hear_each_other_are_in_a_cell_and_all_arrive_in_the_end() {
    for seed in seeds() {
        let what = format!("replay: ROHRPOST_TRAFFIC_FIRST={seed} ROHRPOST_TRAFFIC=1");
        let (mut world, goals) = troubled(seed, SETTINGS, &what);
        calm(&mut world, &goals, &what);
    }
}

/// Robots plan with what each of them knows, at once and again and again: claims alone keep them apart.
#[test]
fn whatever_robots_plan_no_two_that_hear_each_other_are_in_a_cell() {
    for seed in seeds() {
        let hasty = TrafficSettings { agree_ns: 0, stall_ns: S_NS / 2, ..SETTINGS };
        troubled(seed, hasty, &format!("replay: ROHRPOST_TRAFFIC_FIRST={seed} ROHRPOST_TRAFFIC=1"));
    }
}

/// A drawn world after its trouble, and where its robots want to go.
fn troubled(seed: u64, settings: TrafficSettings, what: &str) -> (World, BTreeMap<RobotId, Cell>) {
    let mut chance = Chance::new(seed);
    let (grid, part) = drawn_map(&mut chance);
    let count = chance.between(2, 6) as usize;
    let mut world = World::new(seed, grid);
    world.settings = settings;
    let goals = drawn(&part, count, &mut chance);
    let mut goals: BTreeMap<RobotId, Cell> = (1..).map(crate::world::id).zip(goals).collect();
    let starts = drawn(&part, count, &mut chance);
    for ((robot, goal), at) in goals.iter().zip(starts) {
        world.add(robot.get(), at, Some(*goal));
    }
    trouble(&mut world, &part, &mut goals, &mut chance);
    assert!(world.faults.is_empty(), "{what}: no two that hear each other are in a cell: {:?}", world.faults);
    (world, goals)
}

/// Losses, splits, deaths, restarts and new goals.
fn trouble(world: &mut World, part: &[Cell], goals: &mut BTreeMap<RobotId, Cell>, chance: &mut Chance) {
    world.loss_percent = chance.pick(&[0, 10, 30]);
    for _ in 0..20 {
        world.run(chance.between(500, 4000) * MS_NS);
        let robot = RobotId::new(chance.between(1, goals.len() as u64) as u8).unwrap();
        match chance.below(6) {
            0 => world.body(robot.get()).part = chance.below(2) as u8,
            1 => world.bodies.values_mut().for_each(|body| body.part = 0),
            2 => world.body(robot.get()).is_alive = false,
            3 if !world.body(robot.get()).is_alive => world.restart(robot, Some(goals[&robot])),
            4 => {
                let new: Vec<Cell> = drawn(part, goals.len(), chance);
                goals.values_mut().zip(new).for_each(|(goal, new)| *goal = new);
                let goals = goals.iter();
                goals.for_each(|(robot, goal)| world.body(robot.get()).traffic.set_goal(Some(*goal)));
            }
            _ => {}
        }
    }
}

/// All live, hear each other, and lose nothing.
fn calm(world: &mut World, goals: &BTreeMap<RobotId, Cell>, what: &str) {
    world.loss_percent = 0;
    for (robot, goal) in goals {
        world.body(robot.get()).part = 0;
        if !world.body(robot.get()).is_alive {
            world.restart(*robot, Some(*goal));
        }
    }
    // Robots listen, forget the last round, and agree.
    world.run(SETTINGS.max_age_ns + SETTINGS.stall_ns + SETTINGS.agree_ns);
    let has_arrived = |world: &World| {
        world.bodies.iter().all(|(robot, body)| {
            let is_there = BTreeMap::from([(*robot, goals[robot])]);
            world.are_at(&is_there) || body.traffic.given_up().iter().any(|(other, _)| other == robot)
        })
    };
    world.run_until(240 * S_NS, what, has_arrived);
}
