//! Teams on drawn maps, with losses, splits, deaths, lost and pushed robots: nobody touches anything by moving towards
//! it, and no friend is taken for an intruder.
//!
//! `ROHRPOST_TEAM_SEEDS=2000 cargo test -p rohrpost-virtual-team --test campaign -- --nocapture` is the long run; 20
//! seeds are the rule. A test that fails says its seed; with `ROHRPOST_TEAM_FIRST=SEED ROHRPOST_TEAM_SEEDS=1` it runs
//! that one again.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_arena::Conduct;
use rohrpost_payload::Settings;
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction, Map};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::link::Quality;
use rohrpost_virtual_team::maps;
use rohrpost_virtual_team::standard::{GOOD, S_NS};
use rohrpost_virtual_team::world::World;
use std::collections::BTreeSet;

const SECONDS: u64 = 60;
/// One of so many worlds is crowded.
const CROWDED: u64 = 20;

fn seeds() -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().unwrap());
    let first = number("ROHRPOST_TEAM_FIRST").unwrap_or(0);
    first..first + number("ROHRPOST_TEAM_SEEDS").unwrap_or(20)
}

/// A world with up to two intruders and 1 to 16 robots, in one of twenty up to 64, each in a cell of its own with room
/// around.
fn world(seed: u64, acts_together: bool) -> World {
    let mut chance = Chance::new(seed);
    let (robots, most) = if seed % CROWDED == 7 { (64, 2 * maps::USUAL) } else { (16, maps::USUAL) };
    let text = maps::draw(&mut chance, most);
    let map = Map::read(text.as_bytes()).unwrap();
    let mut settings = Settings::default();
    settings.coordination = settings.coordination.filter(|_| acts_together);
    let mut world = World::new(&text, 1.0, settings, seed);
    let mut free: Vec<Cell> = map.grid.cells().map(|it| it.0).filter(|cell| map.grid.is_path(*cell)).collect();
    let mut take = |chance: &mut Chance| {
        let at = chance.below(free.len() as u64) as usize;
        let cell = (!free.is_empty()).then(|| free.swap_remove(at))?;
        free.retain(|other| !is_beside(*other, cell));
        Some(cell)
    };
    for id in 1..=chance.between(robots / 16, robots) as u8 {
        if let Some(cell) = take(&mut chance) {
            world.add_robot(RobotId::new(id * 3).unwrap(), cell, chance.pick(&Direction::ALL));
        }
    }
    for _ in 0..chance.below(3) {
        let Some(cell) = take(&mut chance) else { continue };
        let conduct = match chance.below(3) {
            0 => Conduct::Stands,
            1 => Conduct::Flees { speed_m_s: 0.4, fears_m: 4.0 },
            _ => {
                let cells = (0..4).map(|_| chance.pick(&[cell, map.grid.cells().next().unwrap().0])).collect();
                Conduct::Script { speed_m_s: 0.3, cells }
            }
        };
        world.add_intruder(cell, conduct);
    }
    world
}

fn is_beside(one: Cell, other: Cell) -> bool {
    one.column.abs_diff(other.column) <= 1 && one.row.abs_diff(other.row) <= 1
}

/// Something goes wrong, by chance.
fn disturb(world: &mut World, chance: &mut Chance) {
    let alive: Vec<RobotId> = world.alive().collect();
    if alive.is_empty() {
        return;
    }
    let one = chance.pick(&alive);
    match chance.below(8) {
        0 => world.kill_robot(one),
        1 | 2 => world.kill_payload(one),
        3 => world.split(alive.into_iter().filter(|_| chance.percent(50)).collect::<Vec<_>>()),
        4 => world.split([]),
        5 => world.set_pose_comes(one, chance.percent(50)),
        6 => world.set_quality(Quality { loss_ppm: chance.below(300_000) as u32, copy_ppm: 10_000, ..GOOD }),
        _ => push(world, one, chance),
    }
}

/// A person carries a robot to a cell from which nobody is near: nobody can brake for what falls from the sky.
fn push(world: &mut World, one: RobotId, chance: &mut Chance) {
    let grid = world.arena.map().grid.clone();
    let placement = world.arena.placement();
    let mut taken: Vec<(f64, f64)> = world.arena.intruders().map(|disc| (disc.x_m, disc.y_m)).collect();
    let poses = world.arena.robots().filter_map(|id| world.arena.moment(id)).map(|moment| moment.pose);
    taken.extend(poses.map(|pose| (pose.x_m, pose.y_m)));
    let is_free = |cell: &Cell| {
        let (x_m, y_m) = placement.middle_m(&grid, *cell);
        grid.is_path(*cell) && taken.iter().all(|it| (it.0 - x_m).hypot(it.1 - y_m) > 3.0)
    };
    let free: Vec<Cell> = grid.cells().map(|it| it.0).filter(is_free).collect();
    if !free.is_empty() {
        world.push(one, chance.pick(&free));
    }
}

/// How to run a seed again, and what its referee has noted.
fn replay(seed: u64, world: &World) -> String {
    let told: Vec<String> = world.arena.referee().incidents().iter().map(ToString::to_string).collect();
    format!(
        "replay: ROHRPOST_TEAM_FIRST={seed} ROHRPOST_TEAM_SEEDS=1 cargo test -p rohrpost-virtual-team --test campaign \
         -- --nocapture\n{}",
        told.join("\n")
    )
}

#[test]
fn nobody_touches_what_it_moves_towards_and_no_friend_is_an_intruder() {
    let (mut modes, mut way_m, mut runs) = (BTreeSet::new(), 0.0, 0);
    for seed in seeds() {
        // In every second one each robot plans for itself.
        let mut world = world(seed, seed % 2 == 0);
        let mut chance = Chance::new(seed ^ 0x5eed);
        let starts: Vec<_> = world.arena.robots().filter_map(|id| Some(world.arena.moment(id)?.pose)).collect();
        while world.now_ns < SECONDS * S_NS {
            world.run_until(world.now_ns + S_NS);
            if chance.percent(20) {
                disturb(&mut world, &mut chance);
            }
            let payloads = world.alive().filter_map(|id| world.payload(id));
            modes.extend(payloads.map(|payload| payload.mode() as u8));
        }
        let ends = world.arena.robots().filter_map(|id| Some(world.arena.moment(id)?.pose));
        way_m += starts.iter().zip(ends).map(|(a, b)| (a.x_m - b.x_m).hypot(a.y_m - b.y_m)).sum::<f64>();
        runs += 1;
        let referee = world.arena.referee();
        assert_eq!(referee.touches_towards(), 0, "{}", replay(seed, &world));
        assert_eq!(world.mistakes(), [""; 0], "{}", replay(seed, &world));
    }
    assert!(runs < 20 || modes.len() == 3, "all modes are seen: {modes:?}");
    assert!(runs < 20 || way_m > 50.0, "robots do drive: {way_m:.1} m");
}

/// With losses, and without splits: all hear each other.
#[test]
fn robots_that_act_together_are_never_two_in_a_cell_and_never_swap() {
    let mut steps = 0;
    for seed in seeds().step_by(4) {
        let mut world = world(seed, true);
        world.set_quality(Quality { loss_ppm: 100_000, copy_ppm: 10_000, ..GOOD });
        let mut cells: Vec<_> = world.arena.robots().map(|id| world.arena.cell(id)).collect();
        while world.now_ns < SECONDS * S_NS {
            world.run_until(world.now_ns + S_NS);
            let now: Vec<_> = world.arena.robots().map(|id| world.arena.cell(id)).collect();
            steps += cells.iter().zip(&now).filter(|(before, now)| before != now).count();
            cells = now;
        }
        let referee = world.arena.referee();
        let counts = (referee.touches_towards(), referee.two_in_cell(), referee.swaps());
        assert_eq!(counts, (0, 0, 0), "{}", replay(seed, &world));
    }
    println!("{steps} steps from cell to cell");
    assert!(seeds().count() < 20 || steps > 60, "robots do go: {steps} steps");
}
