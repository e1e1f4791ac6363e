//! How quick a team is that acts together, beside one in which each robot plans for itself.
//!
//! `ROHRPOST_TEAM_SEEDS=200 cargo test -p rohrpost-virtual-team --test quick -- --nocapture` is the long run.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_arena::Conduct;
use rohrpost_payload::{Mode, Settings};
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction, Map, Obstacle, ObstacleKind, Wave};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_virtual_team::maps;
use rohrpost_virtual_team::scene::{CELL_M, entrances_held};
use rohrpost_virtual_team::standard::S_NS;
use rohrpost_virtual_team::world::World;

/// Robots need a while to hear each other, and agree.
const START_S: u64 = 10;
const MINUTES: u64 = 1;

fn seeds(few: u64) -> u64 {
    std::env::var("ROHRPOST_TEAM_SEEDS").ok().map_or(few, |text| text.parse().unwrap())
}

fn settings(acts_together: bool) -> Settings {
    let settings = Settings::default();
    Settings { coordination: settings.coordination.filter(|_| acts_together), ..settings }
}

/// Robots in a drawn map without an intruder, one for twelve paths.
fn wanderers(seed: u64, acts_together: bool) -> World {
    let mut chance = Chance::new(seed);
    let text = maps::draw(&mut chance, maps::USUAL);
    let map = Map::read(text.as_bytes()).unwrap();
    let mut free: Vec<Cell> = map.grid.cells().map(|it| it.0).filter(|cell| map.grid.is_path(*cell)).collect();
    let mut world = World::new(&text, 1.0, settings(acts_together), seed);
    for id in 1..=1 + free.len() as u8 / 12 {
        let cell = free.swap_remove(chance.below(free.len() as u64) as usize);
        free.retain(|other| other.column.abs_diff(cell.column) + other.row.abs_diff(cell.row) > 1);
        world.add_robot(RobotId::new(id).unwrap(), cell, chance.pick(&Direction::ALL));
        if free.is_empty() {
            break;
        }
    }
    world
}

/// Cells that a robot comes to in a minute.
fn cells_a_minute(mut world: World) -> f64 {
    world.run_s(START_S);
    let robots: Vec<RobotId> = world.alive().collect();
    let mut cells: Vec<Option<Cell>> = robots.iter().map(|id| world.arena.cell(*id)).collect();
    let mut steps = 0;
    while world.now_ns < (START_S + MINUTES * 60) * S_NS {
        world.run_until(world.now_ns + S_NS / 4);
        for (before, id) in cells.iter_mut().zip(&robots) {
            let now = world.arena.cell(*id);
            steps += u32::from(now != *before);
            *before = now;
        }
    }
    f64::from(steps) / (MINUTES as f64 * robots.len() as f64)
}

#[test]
fn robots_that_act_together_wander_about_as_quickly_as_they_can() {
    let (mut together, mut alone) = (0.0, 0.0);
    let count = seeds(3);
    for seed in 0..count {
        let (on, off) = (cells_a_minute(wanderers(seed, true)), cells_a_minute(wanderers(seed, false)));
        println!("seed {seed}: {on:.1} cells a minute and robot together, {off:.1} each for itself");
        (together, alone) = (together + on, alone + off);
    }
    let ratio = together / alone;
    println!("{:.1} of {:.1} cells a minute and robot: {ratio:.2}", together / count as f64, alone / count as f64);
    assert!(ratio > 0.7, "{ratio:.2}");
}

/// A ring, an eight, a hall with pillars, two rooms, and a comb. Blanks keep robots off the walls.
const FLOORS: [&str; 5] = [
    "
****************
*              *
* ............ *
* .          . *
* . ******** . *
* I ******** . *
* . ******** . *
* .          . *
* ............ *
*              *
****************
",
    "
*******************
*                 *
* ............... *
* .      .      . *
* . **** . **** . *
* . **** I **** . *
* . **** . **** . *
* .      .      . *
* ............... *
*                 *
*******************
",
    "
*****************
*               *
* ............. *
* .   .   .   . *
* . * . * . * . *
* .   .   .   . *
* .....I....... *
* .   .   .   . *
* . * . * . * . *
* .   .   .   . *
* ............. *
*               *
*****************
",
    "
*******************
*                 *
* ......   ...... *
* ......   ...... *
* ...I........... *
* ......   ...... *
* ......   ...... *
*                 *
*******************
",
    "
*****************
*               *
* ............. *
* .   .   .   . *
* . * . * . * . *
* .   .   .   . *
* .......I..... *
*               *
*****************
",
];
/// Robots that do not hold all entrances so long after they see the intruder never do, s.
const HELD_MAX_S: u64 = 120;
const SEEN_MAX_S: u64 = 120;

/// Robots on one side of an intruder that stands: one more than it has entrances.
fn beside(seed: u64, acts_together: bool) -> World {
    let (mut chance, mut wave) = (Chance::new(seed), Wave::default());
    let text = FLOORS[seed as usize % FLOORS.len()].trim_start();
    let map = Map::read(text.as_bytes()).unwrap();
    let mut world = World::new(text, CELL_M, settings(acts_together), seed);
    let intruder = map.intruders[0];
    world.add_intruder(intruder, Conduct::Stands);
    let exits: Vec<Cell> = entrances_held(&world).into_keys().collect();
    let body = Obstacle { cell: intruder, kind: ObstacleKind::Intruder };
    let mut steps_from = |exit: Cell| {
        wave.start(&map.grid, exit, [], [body]);
        while wave.next_goal().is_some() {}
        map.grid.cells().map(|(cell, _)| wave.distance(cell).unwrap_or(u32::MAX)).collect::<Vec<u32>>()
    };
    let side = chance.below(exits.len() as u64) as usize;
    let steps: Vec<Vec<u32>> = exits.iter().map(|exit| steps_from(*exit)).collect();
    let cells = map.grid.cells().map(|it| it.0).enumerate();
    let is_near = |at: usize| (1..10).contains(&steps[side][at]) && steps.iter().all(|it| it[at] >= steps[side][at]);
    let mut free: Vec<Cell> = cells.filter(|(at, cell)| is_near(*at) && *cell != intruder).map(|it| it.1).collect();
    for id in 1..=exits.len() as u8 + 1 {
        if free.is_empty() {
            break;
        }
        let cell = free.swap_remove(chance.below(free.len() as u64) as usize);
        world.add_robot(RobotId::new(id).unwrap(), cell, chance.pick(&Direction::ALL));
    }
    world
}

/// Seconds from the moment at which a robot sees the intruder until all its entrances are held.
fn held_after_s(mut world: World) -> f64 {
    let sees = |world: &World| world.alive().any(|id| world.payload(id).unwrap().mode() != Mode::Wandering);
    let seen_ns = world.run_until_holds(SEEN_MAX_S, sees).unwrap_or(world.now_ns);
    let held_ns = world.run_until_holds(HELD_MAX_S, |world| entrances_held(world).values().all(Option::is_some));
    held_ns.map_or(HELD_MAX_S as f64, |held_ns| (held_ns - seen_ns) as f64 / S_NS as f64)
}

#[test]
fn robots_that_act_together_hold_all_entrances_about_as_soon() {
    let (mut together, mut alone, mut never) = (0.0, 0.0, [0, 0]);
    let count = seeds(5);
    for seed in 0..count {
        let (on, off) = (held_after_s(beside(seed, true)), held_after_s(beside(seed, false)));
        println!("seed {seed}: all entrances held after {on:.1} s together, {off:.1} s each for itself");
        (together, alone) = (together + on, alone + off);
        for (never, it) in never.iter_mut().zip([on, off]) {
            *never += u32::from(it >= HELD_MAX_S as f64);
        }
    }
    let ratio = together / alone;
    let (together, alone) = (together / count as f64, alone / count as f64);
    println!("{together:.1} s of {alone:.1} s: {ratio:.2}; {} and {} of {count} never", never[0], never[1]);
    assert!(ratio <= 1.2, "{ratio:.2}");
}
