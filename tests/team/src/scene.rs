//! Scenes that a map draws: robots and intruders on their cells, and what becomes of them.

use crate::world::World;
use rohrpost_arena::Conduct;
use rohrpost_payload::Settings;
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction, Map};
use std::collections::BTreeMap;

/// Cells of drawn maps have this side, metres.
pub const CELL_M: f64 = 1.0;

/// A world as a map in the seed's format draws it: robots from id 1 in the order of the file, all facing alike, and
/// intruders that stand.
///
/// # Panics
/// If the text is no map, or has more robots than a team.
pub fn drawn(map: &str, facing: Direction, settings: Settings, seed: u64) -> World {
    let read = Map::read(map.as_bytes()).unwrap_or_else(|no| panic!("{no}"));
    let mut world = World::new(map, CELL_M, settings, seed);
    for ((cell, _), id) in read.robots.iter().zip(1..) {
        world.add_robot(RobotId::new(id).unwrap_or_else(|| panic!("{id} robots are too many")), *cell, facing);
    }
    read.intruders.iter().for_each(|cell| world.add_intruder(*cell, Conduct::Stands));
    world
}

/// Steps along paths from each robot's cell to the first intruder's, by the shortest way, robots not counted.
pub fn steps_to_intruder(world: &World) -> BTreeMap<RobotId, u32> {
    let (grid, placement) = (&world.arena.map().grid, world.arena.placement());
    let mut wave = rohrpost_team::grid::Wave::default();
    let Some(start) = world.arena.intruders().next().and_then(|disc| placement.cell(grid, disc.x_m, disc.y_m)) else {
        return BTreeMap::new();
    };
    wave.start(grid, start, [], []);
    while wave.next_goal().is_some() {}
    world.arena.robots().filter_map(|id| Some((id, wave.distance(world.arena.cell(id)?)?))).collect()
}

/// Entrances of the first intruder: paths beside its cell, and the robot in each.
pub fn entrances_held(world: &World) -> BTreeMap<Cell, Option<RobotId>> {
    let (grid, placement) = (&world.arena.map().grid, world.arena.placement());
    let Some(start) = world.arena.intruders().next().and_then(|disc| placement.cell(grid, disc.x_m, disc.y_m)) else {
        return BTreeMap::new();
    };
    let beside = Direction::ALL.into_iter().filter_map(|step| start.next(step)).filter(|cell| grid.is_path(*cell));
    beside.map(|cell| (cell, world.alive().find(|id| world.arena.cell(*id) == Some(cell)))).collect()
}
